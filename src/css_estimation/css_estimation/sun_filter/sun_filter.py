# SPDX-License-Identifier: Apache-2.0
"""A Sun filter for any layout of cells, that knows the Earth where it knows its place, with gyro, wheels or neither.

One state: attitude, rate, intensity, the cells' lasting errors, and how the Earth differs from its mean (`memory`). The
heading is the Sun's known direction in n, seen from that attitude; without an orbit model n is a frame of the filter's
own. What the cells say is in `cell_update`, how the body turns in `motion`.

Modes: 0 waiting for light, 1 looking for the Sun over the whole sphere (`sun_search`), 2 converging, the Earth being
unknown, or another Sun possible (`second_sun`), 3 following several turns about the Sun line (`hypotheses`), 4 tracking
with the Earth's light predicted, 5 tracking without, 6 no use made of the cells: dark, penumbra, or outputs that fade
together; the state goes on by its rate. An estimate that can be no longer trusted (most outputs refused, and another
direction explains them better; an error larger than a radian; a step longer than `longest_step`) is dropped and the Sun
looked for anew.

The covariance is that of the filter, and while the Earth is unknown of its light too, which lasts too long to be noise
(`reported`).
"""

import math

from css_common.declared import builder
from css_common.kernel import kernel
from css_common.schema import Values
from css_common.vectors import Vec3, dot
from css_estimation.sun.eclipse_detector import detect_eclipse
from css_estimation.sun.other_sun import no_other_sun
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
from css_estimation.sun_filter import filter_state, options
from css_estimation.sun_filter.calibration import (
    begin_calibration,
    outlast_estimate,
)
from css_estimation.sun_filter.cell_update import NOTHING_READ, READABLE, CellReading
from css_estimation.sun_filter.filter_state import (
    AFRESH,
    MODE_COASTING,
    MODE_SEARCHING,
    MODE_WAITING,
    NO_RATE,
    NOT_FOUND,
    STAGE_HEADING,
    STAGE_ROLL,
    STAGE_SEARCH,
    Cycle,
    Found,
    Progress,
    Rate,
    SunFilterState,
)
from css_estimation.sun_filter.following import track_cycle
from css_estimation.sun_filter.memory import (
    SunFilterMemory,
    new_memory,
    triple,
)
from css_estimation.sun_filter.motion import (
    RATE_BY_GYRO,
    RATE_BY_MOMENTUM,
    gyro_usable,
    rate_model,
    wheel_momentum,
)
from css_estimation.sun_filter.options import SunFilterParameters
from css_estimation.sun_filter.reported import LARGEST, across, mean_variance
from css_estimation.sun_filter.reported import heading as heading_of
from css_estimation.sun_filter.searching import search_cycle
from css_estimation.sun_filter.second_sun import look_beside

_FULL_DISC = 0.99
_SLOWEST_GAIN = 0.05

PARAMETERS = options.PARAMETERS
conflicts = options.conflicts
initial_state = filter_state.initial_state
_built = builder(SunFilterParameters)


class SunFilter(SunFilterParameters):
    """The parameters of this filter: by their type a study finds it."""

    __slots__ = ()


def parameters(values: Values) -> SunFilter:
    """Parameters from checked values."""
    return SunFilter(*_built(values))


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
def _finite(v: Vec3) -> bool:
    return math.isfinite(v[0]) and math.isfinite(v[1]) and math.isfinite(v[2])


@kernel
def knows_earth(state: SunFilterState) -> bool:
    """Whether the light of the Earth is part of the state, and with it the turn about the Sun line."""
    return state.progress.stage == STAGE_ROLL


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
    reading, found, other = NOTHING_READ, state.found, no_other_sun()
    if state.progress.stage == STAGE_SEARCH or dt > p.convergence.longest_step:
        if state.progress.stage != STAGE_SEARCH:
            state = SunFilterState(
                AFRESH, state.rate, NOT_FOUND, state.validity, state.age, state.eclipse, no_other_sun()
            )
            outlast_estimate(p.calibration, p.cells.shape[0], memory, True)
        progress, rate, found = search_cycle(p, state, memory, cycle, voltages, aiding)
        sun_b, covariance = found.sun_b, across(found.sun_b, min(found.variance, LARGEST))
        mode, used = MODE_SEARCHING if progress.begun else MODE_WAITING, lit
        if lit:
            reading = CellReading(0.0, 0, _readable(voltages), 0, 0, 0.0, 0.0, 0.0)
        rate_source = RATE_GYRO if cycle.model == RATE_BY_GYRO else RATE_NONE
    else:
        progress, rate, reading, mode = track_cycle(p, state, memory, cycle, voltages, aiding)
        sun_b, covariance = heading_of(p, memory, aiding.sky.sun_n, progress.stage == STAGE_ROLL, reading.used)
        a_direction = _finite(sun_b) and dot(sun_b, sun_b) > 0.0 and mean_variance(covariance) > 0.0
        if not (a_direction and _finite(triple(covariance, 0)) and _finite(rate.omega_bn_b)):
            # no hypothesis is left, or beyond what numbers can hold: nothing is known any more
            progress, rate = AFRESH, Rate(rate.model, NO_RATE, NO_RATE)
            reading, mode = NOTHING_READ, MODE_COASTING
            sun_b, covariance = state.found.sun_b, across(state.found.sun_b, LARGEST)
        elif progress.stage == STAGE_HEADING:
            beside = look_beside(p, state, memory, sun_b, covariance, reading, cycle, voltages, aiding)
            other, sun_b, covariance = beside.other, beside.sun_b, beside.covariance
            if beside.taken:
                progress = Progress(STAGE_HEADING, True, 0.0, 0.0, 0.0)
        if progress.stage == STAGE_SEARCH:
            outlast_estimate(p.calibration, p.cells.shape[0], memory, False)
            covariance = across(sun_b, LARGEST)
        used = reading.nis_dof > 0
        rate_source = RATE_SUN
        if cycle.model == RATE_BY_GYRO:
            rate_source = RATE_GYRO
        elif cycle.model == RATE_BY_MOMENTUM:
            rate_source = RATE_MOMENTUM
        found = Found(sun_b, LARGEST if progress.stage == STAGE_SEARCH else mean_variance(covariance))
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
    return SunFilterState(progress, rate, found, validity, age, eclipse_state, other), heading
