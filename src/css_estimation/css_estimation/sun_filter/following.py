# SPDX-License-Identifier: Apache-2.0
"""A cycle of the Sun filter with an estimate: all hypotheses go on, read cells and field, and are weighed."""

import math

from css_common.kernel import kernel
from css_common.vectors import Vec3, norm
from css_estimation.sun.sun_heading import Aiding
from css_estimation.sun_filter.calibration import calibrates_now, states_in_use
from css_estimation.sun_filter.cell_update import NOTHING_READ, CellReading, heading_sigma, read_cells
from css_estimation.sun_filter.fading import fading
from css_estimation.sun_filter.field_update import field_usable, read_field
from css_estimation.sun_filter.filter_state import (
    NO_RATE,
    STAGE_ROLL,
    Cycle,
    Progress,
    Rate,
    SunFilterState,
    filtered_rate,
)
from css_estimation.sun_filter.hypotheses import SETTLING, give_up, loosen, the_only_one, weigh
from css_estimation.sun_filter.memory import (
    DEAD,
    EARTH,
    GAIN,
    HYPOTHESES,
    SCALE,
    X_EARTH,
    X_GAIN,
    X_SCALE,
    SunFilterMemory,
)
from css_estimation.sun_filter.motion import change_rate, fade, go_on
from css_estimation.sun_filter.options import SunFilterParameters
from css_estimation.sun_filter.stages import CONVERGED, progress_after

_FIRST_NOISE, _FIRST_TIME = 0.1, 3.0  # [-], [s]
_NOWHERE: Vec3 = (0.0, 0.0, 0.0)


@kernel
def _forget_slowly(
    p: SunFilterParameters, dt: float, rate: float, states: int, earth_known: bool, x, covariance
) -> None:
    """Errors of outputs and Earth go on; on a body that turns [rad/s] a cell soon looks at other clouds."""
    cells = p.cells.shape[0]
    fade(SCALE, X_SCALE, 1, p.errors.scale_time, p.errors.scale, dt, states, x, covariance)
    fade(GAIN, X_GAIN, cells, p.errors.cell_time, p.errors.cell, dt, states, x, covariance)
    if earth_known:
        fade(EARTH, X_EARTH, 1, p.earth.scale_time, p.earth.scale, dt, states, x, covariance)
        clouds_time = 1.0 / (1.0 / p.earth.clouds_time + rate / p.earth.clouds_angle)
        fade(GAIN + cells, X_GAIN + cells, cells, clouds_time, 1.0, dt, states, x, covariance)


@kernel
def _start_noise(since: float) -> float:
    """Variance by what a linear filter makes of large corrections, which come first [s], in units of the largest."""
    return math.exp(-2.0 * since / _FIRST_TIME)


@kernel
def track_cycle(
    p: SunFilterParameters, state: SunFilterState, memory: SunFilterMemory, cycle: Cycle, voltages, aiding: Aiding
) -> tuple[Progress, Rate, CellReading, int]:
    """A cycle with an estimate; gives too what the best hypothesis read, and the mode."""
    before = state.progress
    sun_n, dt = aiding.sky.sun_n, cycle.dt
    cells = p.cells.shape[0]
    earth_known = before.stage == STAGE_ROLL
    states = states_in_use(p.calibration, cells, earth_known)
    learns = earth_known and calibrates_now(p.calibration, before.since)
    faded, use = before.faded, cycle.lit
    best, left = 0, 1
    r_n = aiding.sky.r_n if earth_known else _NOWHERE
    reading, raw_b, use_field = NOTHING_READ, NO_RATE, False
    for k in range(HYPOTHESES):
        if memory.weights[k] <= DEAD:
            continue
        x, covariance = memory.estimates[k], memory.covariances[k]
        if cycle.model != state.rate.model:
            change_rate(p.motion, state.rate.model, cycle.model, state.rate.raw_b, cycle.wheels_b, x, covariance)
        omega_b = go_on(p.motion, cycle.model, aiding.gyro_b, cycle.wheels_b, r_n, dt, states, x, covariance)
        _forget_slowly(p, dt, norm(omega_b), states, earth_known, x, covariance)
        if k == 0 or memory.weights[k] > memory.weights[best]:
            best, raw_b = k, omega_b
    best_x, best_covariance = memory.estimates[best], memory.covariances[best]
    # when turns begin to be looked for outputs are not as expected; a model of the orbit may be late by as much as a
    # place errs
    settled = not earth_known or the_only_one(memory) == best or before.since > SETTLING
    if not use:
        # light that comes back has to be whole again
        faded = max(faded, dt)
    elif settled and heading_sigma(best_covariance, sun_n) < CONVERGED:
        faded = fading(p, best_x, best_covariance, sun_n, cycle.flux, voltages, faded, dt)
        use = faded == 0.0
    if use:
        # each turn begins with the heading that an unknown Earth left, and has the Earth's light where that puts it
        more_noise = _start_noise(before.since)
        if not earth_known:
            more_noise = p.earth.unknown**2 + _FIRST_NOISE**2 * more_noise
        for k in range(HYPOTHESES):
            if memory.weights[k] <= DEAD:
                continue
            x, covariance = memory.estimates[k], memory.covariances[k]
            if earth_known:
                loosen(covariance, sun_n, before.since, dt)
            read = read_cells(
                p,
                voltages,
                sun_n,
                cycle.flux,
                more_noise,
                earth_known,
                learns,
                aiding.sky.light,
                states,
                x,
                covariance,
                memory,
            )
            weigh(memory, k, read.likelihood)
            if k == best:
                reading = read
    if earth_known and field_usable(p, aiding):
        for k in range(HYPOTHESES):
            if memory.weights[k] > DEAD:
                x, covariance = memory.estimates[k], memory.covariances[k]
                field = read_field(p, aiding.field_b, aiding.sky.field_n, learns, states, x, covariance, memory)
                weigh(memory, k, field.likelihood)
        use_field = True
    if use or use_field:
        best, left = give_up(memory)
    progress, mode = progress_after(
        p, before, memory, best, left, cycle, use, faded, reading, state.other.apart, voltages, aiding
    )
    return progress, filtered_rate(p, state.rate, cycle, raw_b), reading, mode
