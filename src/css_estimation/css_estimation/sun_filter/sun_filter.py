# SPDX-License-Identifier: Apache-2.0
"""A Sun filter for any layout of cells, that knows the Earth where it knows its place, with gyro, wheels or neither.

One state: attitude, rate, intensity, the cells' lasting errors, and how the Earth differs from its mean (`memory`). The
heading is the Sun's known direction in n, seen from that attitude; without an orbit model n is a frame of the filter's
own. What the cells say is in `cell_update`, how the body turns in `motion`.

Modes: 0 waiting for light, 1 looking for the Sun over the whole sphere (`sun_search`), 2 converging, the Earth being
unknown, 3 following several turns about the Sun line (`hypotheses`), 4 tracking with the Earth's light predicted,
5 tracking without, 6 no use made of the cells: dark, penumbra, or outputs that fade together; the state goes on by its
rate. An estimate that can be no longer trusted (most outputs refused, and another direction explains them better; an
error larger than a radian; a step longer than `longest_step`) is dropped and the Sun looked for anew.

The covariance is that of the filter, and while the Earth is unknown of its light too, which lasts too long to be noise
(`albedo.unknown_heading_deg`).
"""

import math
from typing import NamedTuple

from css_common.attitude import rotation_vector_to_dcm
from css_common.declared import builder
from css_common.kernel import kernel
from css_common.matrices import IDENTITY
from css_common.schema import Values
from css_common.vectors import Vec3, dot, matmul, multiply, norm, scale, unit
from css_estimation.sun import eclipse_detector
from css_estimation.sun.eclipse_detector import EclipseState, detect_eclipse
from css_estimation.sun.low_pass import low_pass, low_pass_gain
from css_estimation.sun.sun_heading import (
    NO_COVARIANCE,
    RATE_GYRO,
    RATE_MOMENTUM,
    RATE_NONE,
    RATE_SUN,
    VALIDITY_HELD,
    VALIDITY_NONE,
    VALIDITY_VALID,
    Aiding,
    SunHeading,
)
from css_estimation.sun.sun_tracking import elapsed
from css_estimation.sun_filter import options
from css_estimation.sun_filter.calibration import (
    begin_calibration,
    calibrates_now,
    outlast_estimate,
    states_in_use,
)
from css_estimation.sun_filter.cell_update import NOTHING_READ, READABLE, CellReading, heading_sigma, read_cells
from css_estimation.sun_filter.fading import fading
from css_estimation.sun_filter.field_update import field_usable, read_field
from css_estimation.sun_filter.hypotheses import (
    begin,
    earth_is_elsewhere,
    give_up,
    look_again,
    look_for_roll,
    loosen,
    the_only_one,
    weigh,
)
from css_estimation.sun_filter.memory import (
    DEAD,
    DIRECTIONS,
    EARTH,
    GAIN,
    HYPOTHESES,
    SCALE,
    X_EARTH,
    X_GAIN,
    X_SCALE,
    SunFilterMemory,
    dcm_of,
    new_memory,
    set_dcm,
    triple,
)
from css_estimation.sun_filter.motion import (
    RATE_BY_GYRO,
    RATE_BY_MOMENTUM,
    RATE_BY_WALK,
    change_rate,
    fade,
    go_on,
    gyro_usable,
    rate_model,
    wheel_momentum,
)
from css_estimation.sun_filter.options import SunFilterParameters
from css_estimation.sun_filter.reported import LARGEST, across, mean_variance
from css_estimation.sun_filter.reported import heading as heading_of
from css_estimation.sun_filter.sun_search import cost, least_cost, search

MODE_WAITING = 0
MODE_SEARCHING = 1
MODE_CONVERGING = 2
MODE_ROLLS = 3
MODE_EARTH = 4
MODE_NO_EARTH = 5
MODE_COASTING = 6

_STAGE_SEARCH, _STAGE_HEADING, _STAGE_ROLL = 0, 1, 2

_SHORTEST_SEARCH = 0.95  # [s]
_SHORTEST_CONVERGENCE = 3.0  # [s]
_CONTRARY_TIME = 5.0  # [s]
_CONTRARY_SHARE = 0.4
# Another direction has to explain the outputs better by this much before the estimate is given up for it.
_BETTER = 6.0
_LOST = 1.0  # [rad] error of the heading beyond which there is no estimate
_FULL_DISC = 0.99
_SLOWEST_GAIN = 0.05
_FIRST_NOISE, _FIRST_TIME = 0.1, 3.0  # [-], [s]
_CONVERGED = 0.1  # [rad] error of the heading below which outputs can be told to fade
_NO_RATE: Vec3 = (0.0, 0.0, 0.0)
_NOWHERE: Vec3 = (0.0, 0.0, 0.0)

PARAMETERS = options.PARAMETERS
conflicts = options.conflicts
_built = builder(SunFilterParameters)


class SunFilter(SunFilterParameters):
    """The parameters of this filter: by their type a study finds it."""

    __slots__ = ()


def parameters(values: Values) -> SunFilter:
    """Parameters from checked values."""
    return SunFilter(*_built(values))


class Progress(NamedTuple):
    """How far the filter has come."""

    stage: int  # _STAGE_*
    begun: bool  # light has been seen since the search began
    since: float  # [s] of light in this stage
    contrary: float  # share of late cycles that contradict the estimate
    faded: float  # [s] how long outputs have been too low


class Rate(NamedTuple):
    """How the body turns."""

    model: int  # RATE_BY_*
    raw_b: Vec3  # [rad/s] in the last cycle
    omega_bn_b: Vec3  # [rad/s] as reported


class Found(NamedTuple):
    """The Sun by the search alone."""

    sun_b: Vec3
    variance: float  # [rad2] on the worst axis


class SunFilterState(NamedTuple):
    """Carried from cycle to cycle beside the memory."""

    progress: Progress
    rate: Rate
    found: Found
    validity: int
    age: float  # [s]
    eclipse: EclipseState


class Cycle(NamedTuple):
    """What both ways of going on are given."""

    dt: float  # [s]
    flux: float  # [-] of the Sun
    lit: bool  # cells may be used
    model: int  # RATE_BY_* of this cycle
    wheels_b: Vec3  # [N m s]


_AFRESH = Progress(_STAGE_SEARCH, False, 0.0, 0.0, 0.0)
_NOT_FOUND = Found((0.0, 0.0, 1.0), math.pi)


def initial_state(p: SunFilterParameters) -> SunFilterState:
    """Nothing known."""
    rate = Rate(RATE_BY_WALK, _NO_RATE, _NO_RATE)
    return SunFilterState(_AFRESH, rate, _NOT_FOUND, VALIDITY_NONE, 0.0, eclipse_detector.initial_state())


def initial_memory(p: SunFilterParameters) -> SunFilterMemory:
    """Room for all hypotheses."""
    memory = new_memory(len(p.cells), p.calibration.per_cell)
    begin_calibration.py_func(p.calibration, len(p.cells), memory.estimates[0], memory.covariances[0])
    return memory


def heading_gain(values: Values) -> float:
    """Gain across the Sun line of a cycle, for the check of the loop: a lag of two seconds at 10 Hz, more than it has.

    The heading follows the rate at once; only what cells correct of it comes later.
    """
    return _SLOWEST_GAIN


@kernel
def bit_count(mask: int) -> int:
    """Bits that are set."""
    count = 0
    while mask:
        mask &= mask - 1
        count += 1
    return count


@kernel
def _brightest(p: SunFilterParameters, voltages) -> float:
    """Largest readable output as calibrated [-]; 0 when none is above that."""
    largest = 0.0
    for i in range(voltages.shape[0]):
        # a NaN compares false
        if abs(voltages[i]) < READABLE:
            largest = max(largest, (voltages[i] - p.cells[i].dark) / max(p.cells[i].gain, 0.01))
    return largest


@kernel
def _readable(voltages) -> int:
    """Mask of the outputs that are readings."""
    mask = 0
    for i in range(voltages.shape[0]):
        # a NaN compares false
        if abs(voltages[i]) < READABLE:
            mask |= 1 << i
    return mask


@kernel
def _sunlight(p: SunFilterParameters, aiding: Aiding, largest: float) -> tuple[float, bool]:
    """Sunlight to reckon with, 1 at 1 AU, and whether cells may be used: lit, and the whole disc in view."""
    lit = largest > p.convergence.minimum_output
    sky = aiding.sky
    if not sky.known:
        return 1.0, lit
    # where the model says night and cells say bright day, the model is wrong
    bright_night = sky.illumination <= 0.0 and largest > 2.0 * p.convergence.minimum_output
    return sky.solar_flux, lit and (sky.illumination > _FULL_DISC or bright_night)


@kernel
def _filtered_rate(p: SunFilterParameters, rate: Rate, cycle: Cycle, raw_b: Vec3) -> Rate:
    """The rate as reported: a gyro's through the low-pass filter, another as it is: the filter has smoothed it."""
    omega_bn_b = raw_b
    if cycle.model == RATE_BY_GYRO:
        omega_bn_b = low_pass(rate.omega_bn_b, raw_b, low_pass_gain(p.motion.cutoff, cycle.dt))
    return Rate(cycle.model, raw_b, omega_bn_b)


@kernel
def _search(
    p: SunFilterParameters, state: SunFilterState, memory: SunFilterMemory, cycle: Cycle, voltages, aiding: Aiding
) -> tuple[Progress, Rate, Found]:
    """A cycle without an estimate; the attitude of the first hypothesis is the frame in which directions are fixed."""
    before = state.progress
    x = memory.estimates[0]
    begun, since = before.begun, before.since
    raw_b = aiding.gyro_b if cycle.model == RATE_BY_GYRO else _NO_RATE
    found = state.found
    if begun:
        turn = rotation_vector_to_dcm(scale(cycle.dt, raw_b))
        set_dcm(x, matmul(turn, dcm_of(x)))
        found = Found(unit(multiply(turn, found.sun_b)), found.variance)
    stage = _STAGE_SEARCH
    if cycle.lit:
        if not begun:
            set_dcm(x, IDENTITY)
            for g in range(DIRECTIONS):
                memory.grid[g] = 0.0
            begun, since = True, 0.0
        since += cycle.dt
        turns = cycle.model == RATE_BY_GYRO
        mean_n, variance = search(p, memory.grid, dcm_of(x), voltages, cycle.flux, cycle.dt, turns)
        found = Found(multiply(dcm_of(x), mean_n), variance)
        if since > _SHORTEST_SEARCH and variance < p.convergence.search_variance:
            begin(p, memory, found.sun_b, variance, aiding.sky.sun_n, cycle.model, cycle.wheels_b)
            stage, since = _STAGE_HEADING, 0.0
    return Progress(stage, begun, since, 0.0, 0.0), _filtered_rate(p, state.rate, cycle, raw_b), found


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
    """Variance of outputs [-] by what a linear filter makes of large corrections, which come first [s]."""
    return (_FIRST_NOISE * math.exp(-since / _FIRST_TIME)) ** 2


@kernel
def _lost(p: SunFilterParameters, contrary: float, sigma: float, x, sun_n: Vec3, flux: float, voltages) -> bool:
    """Whether an estimate has to be dropped."""
    if not sigma < _LOST:
        return True
    if contrary <= _CONTRARY_SHARE:
        return False
    here = cost(p, voltages, flux, multiply(dcm_of(x), sun_n))
    return here - least_cost(p, voltages, flux) > _BETTER


@kernel
def _track(
    p: SunFilterParameters, state: SunFilterState, memory: SunFilterMemory, cycle: Cycle, voltages, aiding: Aiding
) -> tuple[Progress, Rate, CellReading, int]:
    """A cycle with an estimate; gives too what the best hypothesis read, and the mode."""
    before = state.progress
    sun_n, dt = aiding.sky.sun_n, cycle.dt
    cells = p.cells.shape[0]
    earth_known = before.stage == _STAGE_ROLL
    states = states_in_use(p.calibration, cells, earth_known)
    learns = earth_known and calibrates_now(p.calibration, before.since)
    faded, use = before.faded, cycle.lit
    best, left = 0, 1
    r_n = aiding.sky.r_n if earth_known else _NOWHERE
    reading, raw_b, use_field = NOTHING_READ, _NO_RATE, False
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
    # while turns are looked for outputs are not as expected; a model of the orbit may be late by as much as a place
    # errs
    settled = not earth_known or the_only_one(memory) == best
    if not use:
        # light that comes back has to be whole again
        faded = max(faded, dt)
    elif settled and heading_sigma(best_covariance, sun_n) < _CONVERGED:
        faded = fading(p, best_x, best_covariance, sun_n, cycle.flux, voltages, faded, dt)
        use = faded == 0.0
    if use:
        more_noise = 0.0 if earth_known else p.earth.unknown**2 + _start_noise(before.since)
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
    progress, mode = _progress(p, before, memory, best, left, cycle, use, faded, reading, voltages, aiding)
    return progress, _filtered_rate(p, state.rate, cycle, raw_b), reading, mode


@kernel
def _progress(
    p: SunFilterParameters,
    before: Progress,
    memory: SunFilterMemory,
    best: int,
    left: int,
    cycle: Cycle,
    use: bool,
    faded: float,
    reading: CellReading,
    voltages,
    aiding: Aiding,
) -> tuple[Progress, int]:
    """Which stage comes next, and the mode of this cycle."""
    stage, since, contrary = before.stage, before.since, before.contrary
    x, covariance = memory.estimates[best], memory.covariances[best]
    sun_n = aiding.sky.sun_n
    sigma = heading_sigma(covariance, sun_n)
    mode = MODE_COASTING
    if use:
        since += cycle.dt
        mode = MODE_EARTH if left == 1 else MODE_ROLLS
        if stage == _STAGE_HEADING:
            mode = MODE_CONVERGING if aiding.sky.known or sigma > _CONVERGED else MODE_NO_EARTH
        refused = bit_count(reading.refused)
        if refused + reading.nis_dof > 0:
            share = 1.0 if reading.contrary > 0 else refused / (refused + reading.nis_dof)
            contrary += (share - contrary) * min(1.0, cycle.dt / _CONTRARY_TIME)
    if left == 0 or _lost(p, contrary, sigma, x, sun_n, cycle.flux, voltages):
        return _AFRESH, mode
    if contrary > _CONTRARY_SHARE:
        contrary = 0.0
    # the field tells the turn at once, whatever the Earth
    told = field_usable(p, aiding)
    enough = p.convergence.search_variance if told else p.convergence.roll_variance
    converged = stage == _STAGE_HEADING and (told or since > _SHORTEST_CONVERGENCE) and sigma * sigma < enough
    if use and aiding.sky.known and converged:
        look_for_roll(p, memory, sun_n)
        stage, since = _STAGE_ROLL, 0.0
    elif stage == _STAGE_ROLL and left == 1 and earth_is_elsewhere(p, x):
        look_again(p, memory, best, sun_n)
        since = 0.0
    return Progress(stage, True, since, contrary, faded), mode


@kernel
def _finite(v: Vec3) -> bool:
    return math.isfinite(v[0]) and math.isfinite(v[1]) and math.isfinite(v[2])


@kernel
def knows_earth(state: SunFilterState) -> bool:
    """Whether the light of the Earth is part of the state, and with it the turn about the Sun line."""
    return state.progress.stage == _STAGE_ROLL


@kernel
def step(
    p: SunFilterParameters,
    state: SunFilterState,
    memory: SunFilterMemory,
    dt: float,
    voltages,
    aiding: Aiding,
) -> tuple[SunFilterState, SunHeading]:
    """One cycle; arguments in `css_estimation.sun.sun_algorithm`."""
    dt = elapsed(dt)
    largest = _brightest(p, voltages)
    flux, lit = _sunlight(p, aiding, largest)
    eclipse_state, eclipse = detect_eclipse(p.eclipse, state.eclipse, dt, largest, aiding.sky.predicted)
    wheels_b, wheels_ok = wheel_momentum(p.motion, aiding)
    cycle = Cycle(dt, flux, lit, rate_model(p.motion, gyro_usable(p.motion, aiding), wheels_ok), wheels_b)
    reading, found = NOTHING_READ, state.found
    if state.progress.stage == _STAGE_SEARCH or dt > p.convergence.longest_step:
        if state.progress.stage != _STAGE_SEARCH:
            state = SunFilterState(_AFRESH, state.rate, _NOT_FOUND, state.validity, state.age, state.eclipse)
            outlast_estimate(p.calibration, p.cells.shape[0], memory, True)
        progress, rate, found = _search(p, state, memory, cycle, voltages, aiding)
        sun_b, covariance = found.sun_b, across(found.sun_b, min(found.variance, LARGEST))
        mode, used = MODE_SEARCHING if progress.begun else MODE_WAITING, lit
        if lit:
            reading = CellReading(0.0, 0, _readable(voltages), 0, 0, 0.0, 0.0)
        rate_source = RATE_GYRO if cycle.model == RATE_BY_GYRO else RATE_NONE
    else:
        progress, rate, reading, mode = _track(p, state, memory, cycle, voltages, aiding)
        sun_b, covariance = heading_of(p, memory, aiding.sky.sun_n, progress.stage == _STAGE_ROLL)
        a_direction = _finite(sun_b) and dot(sun_b, sun_b) > 0.0 and mean_variance(covariance) > 0.0
        if not (a_direction and _finite(triple(covariance, 0)) and _finite(rate.omega_bn_b)):
            # no hypothesis is left, or beyond what numbers can hold: nothing is known any more
            progress, rate = _AFRESH, Rate(rate.model, _NO_RATE, _NO_RATE)
            reading, mode = NOTHING_READ, MODE_COASTING
            sun_b, covariance = state.found.sun_b, across(state.found.sun_b, LARGEST)
        if progress.stage == _STAGE_SEARCH:
            outlast_estimate(p.calibration, p.cells.shape[0], memory, False)
        used = reading.nis_dof > 0
        rate_source = RATE_SUN
        if cycle.model == RATE_BY_GYRO:
            rate_source = RATE_GYRO
        elif cycle.model == RATE_BY_MOMENTUM:
            rate_source = RATE_MOMENTUM
        found = Found(sun_b, LARGEST if progress.stage == _STAGE_SEARCH else mean_variance(covariance))
    validity = state.validity
    if used:
        validity = VALIDITY_VALID
    elif validity == VALIDITY_VALID:
        validity = VALIDITY_HELD
    age = 0.0 if used or validity == VALIDITY_NONE else state.age + dt
    if validity == VALIDITY_NONE:
        sun_b, covariance = (0.0, 0.0, 0.0), NO_COVARIANCE
    heading = SunHeading(
        sun_b,
        covariance,
        rate.omega_bn_b,
        age,
        reading.nis,
        reading.nis_dof,
        reading.used,
        validity,
        rate_source,
        eclipse,
        mode,
        isolated=0,
        sensors_left=0,
    )
    return SunFilterState(progress, rate, found, validity, age, eclipse_state), heading
