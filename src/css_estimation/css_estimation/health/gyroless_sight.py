# SPDX-License-Identifier: Apache-2.0
"""The Sun as the cells alone show it, without the help of any gyro: what the gyro is held against.

The direction that cells are judged by is carried along with the gyro, and one that lies takes it along; so does the
heading of an estimator. Here the Sun line filter of O'Keefe & Schaub flies without a gyro, as it does where there is
none, on the cells that can be trusted. It follows one Sun, and takes a dark cell for one at 90 deg from it
(`sunline_cycle`): what it is sure of and which misfits contradict is set for that filter, not for what `ekf` adds. Of
cells in a plane, which leave two Suns at all times, it is sure of none.
"""

import math
from typing import Any, NamedTuple

from css_common.declared import built
from css_common.kernel import kernel
from css_common.schema import Parameter, Values
from css_common.vectors import Vec3, norm
from css_estimation.health.cell_expectation import DOUBTFUL, HIDDEN, SEEN, SURE, expected
from css_estimation.health.cell_options import CellHealthParameters
from css_estimation.health.rate_checks import LARGEST_UNKNOWN, RateChecks, unknown_turn
from css_estimation.health.sight import Sight
from css_estimation.sun import sunline_cycle
from css_estimation.sun.cell_layout import READABLE, cosine_on
from css_estimation.sun.left_open import spans_space, tell_one_sun
from css_estimation.sun.sun_heading import VALIDITY_VALID, Aiding, Sky, SunHeading
from css_estimation.sun.sun_tracking import TrackingState
from css_estimation.sun.sunline_cycle import SunlineParameters, SunlineState, step_alone
from css_estimation.symmetric import Symmetric, add_outer, isotropic, trace

_SURE = 0.01  # [rad^2] along the better axis: 6 deg
# Where one or two cells see the Sun, the direction that they do not tell has to get uncertain as fast as a body turns
# that nothing is known of.
_GYROLESS = {"process_sigma": 0.03}
# A filter that follows the gyro through ten seconds before cells move it, and thinks well of cells.
_GYRO_LED = {"process_sigma": 0.0015, "cell_sigma": 0.05}
_MEMORY = 5.0  # [s] of which misfits are averaged
_SETTLING = 5.0  # [s] in which a Sun that was found may still move
_LONG = 10.0  # [s] after which a filter has shown that it fits, or not
_FIT, _GROSS = 0.5, 12.0
_STRIKES = 2
_FOUND = 0.1  # [rad^2] of a Sun that is found: 18 deg
_PATIENCE = 30.0  # [s] of light
MOST_FOLLOWED = 0.5
"""Turn [rad] of a body between two looks that a filter without a gyro follows: what cells say is linear in less."""
_ALONG = 1e-4  # [rad^2] along the Sun line
_NO_EARTH = 0.3  # [-] more than the Earth gives a cell
_NO_RATE = (0.0, 0.0, 0.0)


class _Instead:
    """Values of an estimator, with defaults of the filter for what it does not declare, and some others instead."""

    def __init__(self, values: Values, **instead: Any) -> None:
        self._values, self._instead = values, instead

    def __getitem__(self, parameter: Parameter[Any]) -> Any:
        if parameter.name in self._instead:
            return self._instead[parameter.name]
        return self._values[parameter] if parameter in self._values else _converted(parameter)

    def __contains__(self, parameter: Parameter[Any]) -> bool:
        return True

    def __getattr__(self, name: str) -> Any:
        return getattr(self._values, name)


def _converted(parameter: Parameter[Any]) -> Any:
    return parameter.check(parameter.default)


def gyroless_parameters(values: Values) -> SunlineParameters:
    """Of the filter without a gyro, for the cells of a mission."""
    return built(SunlineParameters, _Instead(values, use_gyro=False, **_GYROLESS))  # type: ignore[arg-type]


def gyro_led_parameters(values: Values) -> SunlineParameters:
    """Of the filter that believes the gyro, for the cells of a mission."""
    return built(SunlineParameters, _Instead(values, use_gyro=True, **_GYRO_LED))  # type: ignore[arg-type]


class Gyroless(NamedTuple):
    """The filter without a gyro."""

    filter: SunlineState
    found: bool  # it has begun where all cells together show the Sun
    waited: float  # [s] that it has seen light, until then


def initial_state(p: SunlineParameters) -> Gyroless:
    """Waiting for light."""
    return Gyroless(sunline_cycle.initial_state(p), False, 0.0)


class Glimpse(NamedTuple):
    """Direction to the Sun by cells without a gyro, of the last cycle."""

    sun_b: Vec3  # [-] unit vector
    covariance: Symmetric  # [rad^2] next to nothing along it
    known: bool


@kernel
def glimpse_of(sight: Sight) -> Glimpse:
    """A sight that is known equally well across."""
    x, y, z = sight.sun_b
    v = sight.variance
    covariance = (v - v * x * x, -v * x * y, -v * x * z, v - v * y * y, -v * y * z, v - v * z * z)
    return Glimpse(sight.sun_b, covariance, sight.known)


@kernel
def _stepped(
    p: SunlineParameters, state: SunlineState, dt: float, voltages, aiding: Aiding, unknown: float
) -> tuple[SunlineState, SunHeading]:
    """One cycle of a filter in which the body may have turned by what no rate tells, a variance [rad^2]."""
    # here, as kernels hand no arrays back
    unsure = SunlineParameters(
        p.layout,
        p.gate,
        p.cell_variance,
        p.process_noise + unknown / max(dt, 1e-9),
        p.process_noise_without_rate + unknown / max(dt, 1e-9),
        p.initial_variance,
        p.largest_variance,
        p.propagate_filtered,
        p.tracking,
    )
    return step_alone(unsure, state, dt, voltages, aiding)


@kernel
def _shows_the_sun(p: SunlineParameters, voltages) -> bool:
    """Whether what the cells see is the Sun, and one Sun.

    Cells that see all of the sky do so together, dark ones too. Else a dark one says nothing of how far the Sun is
    beyond its edge, and bright ones alone, brighter than the Earth makes them, have to span space.
    """
    if p.tracking.eclipse.sees_all:
        return tell_one_sun(p.layout.cells, voltages)
    bright = 0
    for i in range(voltages.shape[0]):
        # a NaN compares false
        if _NO_EARTH < voltages[i] < READABLE:
            bright |= 1 << i
    return spans_space(p.layout.cells, bright)


@kernel
def look(
    p: SunlineParameters,
    checks: RateChecks,
    state: Gyroless,
    dt: float,
    voltages,
    speeds,
    sky: Sky,
    found: bool,
    found_b: Vec3,
) -> tuple[Gyroless, Glimpse]:
    """State and sight after one cycle.

    What the filter begins with by itself, where few cells see the Sun, may be far off and not know it: it begins anew
    where the Sun is found over the whole sphere, or is believed after long.

    Args:
        checks: what the body may do between two cycles.
        dt: [s] since the last cycle.
        voltages: (N,) [-] of cells that can be trusted, NaN for all others.
        speeds: (0,) of no wheels.
        sky: of the flight's models.
        found, found_b: the Sun is found by all cells together, and where.
    """
    before = state.filter
    unknown = unknown_turn(checks, norm(before.tracking.omega_bn_b), dt)
    if unknown > LARGEST_UNKNOWN:
        # a Sun that was found is somewhere else now
        state, found = Gyroless(before, False, 0.0), False
    if found and not state.found:
        before = _begun(before, found_b, isotropic(_FOUND))
    unaided = Aiding(_NO_RATE, False, _NO_RATE, False, speeds, False, sky)
    after, heading = _stepped(p, before, dt, voltages, unaided, unknown)
    lit = heading.validity == VALIDITY_VALID and after.started
    waited = state.waited + dt if lit else state.waited
    believed = lit and (found or state.found or waited > _PATIENCE)
    followed = norm(after.tracking.omega_bn_b) * dt < MOST_FOLLOWED
    known = believed and followed and least_across(after.covariance) < _SURE and _shows_the_sun(p, voltages)
    return Gyroless(after, found or state.found, waited), Glimpse(heading.sun_b, after.covariance, known)


@kernel
def _begun(state: SunlineState, sun_b: Vec3, covariance: Symmetric) -> SunlineState:
    t = state.tracking
    tracking = TrackingState(sun_b, t.omega_bn_b, t.age, t.validity, t.rate_source, t.field, t.eclipse, t.light)
    return SunlineState(True, covariance, tracking)


class Led(NamedTuple):
    """A Sun line filter that believes the gyro, begun where the cells alone saw the Sun."""

    filter: SunlineState
    misfit: float  # [-] squared sigmas per cell, averaged
    since: float  # [s] since it was begun; negative: until it is, while the Sun is in sight
    strikes: int  # how often it has ended in misfits; it begins with 1 once it has long fitted


def initial_led(p: SunlineParameters) -> Led:
    """Waiting for a sight."""
    return Led(sunline_cycle.initial_state(p), 0.0, -_SETTLING, 0)


@kernel
def contradicts(led: Led) -> bool:
    """Whether gyro and cells contradict one another, and not for a bad beginning."""
    return led.strikes >= _STRIKES


@kernel
def waiting(led: Led) -> Led:
    """Begins anew when the Sun has been in sight for long."""
    return Led(led.filter, 0.0, -_SETTLING, 0)


@kernel
def _begin(led: Led, glimpse: Glimpse, strikes: int) -> Led:
    covariance = add_outer(glimpse.covariance, _ALONG, glimpse.sun_b)
    return Led(_begun(led.filter, glimpse.sun_b, covariance), 0.0, 0.0, strikes)


@kernel
def _misfit(p: SunlineParameters, cells: CellHealthParameters, state: SunlineState, voltages) -> tuple[float, int]:
    """Sum of the squared sigmas by which outputs are off, and of how many cells.

    Those of cells on the edge of whose view the Sun may be are left out: a heading that is right within its error puts
    it inside where it is outside, and the output is off by half of the Sun whatever the gyro says. So is light on a
    hidden cell that the Earth may throw.
    """
    total, count = 0.0, 0
    sun_b = state.tracking.sun_b
    for i in range(voltages.shape[0]):
        v = voltages[i]
        # a NaN compares false
        if not abs(v) < READABLE:
            continue
        seen = expected(cells, i, sun_b, state.covariance, 1.0, SURE).sight
        if seen == DOUBTFUL or (seen == HIDDEN and v < cells.earth):
            continue
        off = v - (cosine_on(p.layout, i, sun_b) if seen == SEEN else 0.0)
        total += off * off / p.cell_variance
        count += 1
    return total, count


@kernel
def follow_gyro(
    p: SunlineParameters,
    cells: CellHealthParameters,
    led: Led,
    dt: float,
    voltages,
    speeds,
    sky: Sky,
    gyro_b: Vec3,
    gyro_valid: bool,
    glimpse: Glimpse,
    largest: float,
    unknown: float,
) -> Led:
    """After one cycle; a filter whose cells misfit is begun anew where the cells alone see the Sun.

    Args:
        gyro_b, gyro_valid: of the cycle of the voltages.
        glimpse: of the same.
        largest: misfit that contradicts.
        unknown: of the turn in `dt`, as of `unknown_turn` [rad^2].
    """
    # where the body may be anywhere, nobody leads
    if not gyro_valid or unknown > LARGEST_UNKNOWN:
        return Led(led.filter, 0.0, -_SETTLING, led.strikes)
    if led.since < 0.0:
        since = led.since + dt if glimpse.known else -_SETTLING
        return _begin(led, glimpse, led.strikes) if since >= 0.0 else Led(led.filter, 0.0, since, led.strikes)
    aided = Aiding(gyro_b, True, _NO_RATE, False, speeds, False, sky)
    state, heading = _stepped(p, led.filter, dt, voltages, aided, unknown)
    misfit, since = led.misfit, led.since + dt
    squares, count = _misfit(p, cells, state, voltages)
    if heading.nis_dof > 0 and count > 0:
        misfit += min(dt / _MEMORY, 1.0) * (squares / count - misfit)
    # what no bad beginning explains counts at once
    gross = misfit > _GROSS * largest and since > _MEMORY
    if gross or (misfit > largest and since > _LONG):
        strikes = _STRIKES if gross else min(led.strikes + 1, _STRIKES)
        return _begin(led, glimpse, strikes) if glimpse.known else Led(state, misfit, since, strikes)
    fits = misfit < _FIT * largest and since > _LONG
    return Led(state, misfit, since, 1 if fits else led.strikes)


@kernel
def least_across(p: Symmetric) -> float:
    """The smaller of the two variances across a direction, of a covariance that has next to none along it."""
    half = 0.5 * trace(p)
    return half - _half_difference(p, half)


@kernel
def most_across(p: Symmetric) -> float:
    """The larger of the two."""
    half = 0.5 * trace(p)
    return half + _half_difference(p, half)


@kernel
def _half_difference(p: Symmetric, half: float) -> float:
    product = p[0] * p[3] - p[1] * p[1] + p[0] * p[5] - p[2] * p[2] + p[3] * p[5] - p[4] * p[4]
    return math.sqrt(max(half * half - product, 0.0))
