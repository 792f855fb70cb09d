# SPDX-License-Identifier: Apache-2.0
"""Whether the magnetometer is right: by its samples, and by what no turn of the body changes.

Strength of the field and its angle to the Sun line are the same in b and in n. Where the place in orbit is known, and
with it the field in n, both are held against the model; elsewhere they may change no faster than an orbit makes them.
A magnetometer whose error is constant, on a body that does not turn, cannot be told from a right one without the model.

A magnetometer that fails is left until all has been as it should for a time, twice as long after each time.
"""

import math
from typing import NamedTuple

from css_common.conversions import tesla
from css_common.declared import computed, given, made, table_of
from css_common.health import (
    EVIDENCE_DEAD,
    EVIDENCE_FIELD,
    EVIDENCE_NOISE,
    EVIDENCE_SUN,
    KIND_BIAS,
    KIND_SILENT,
    KIND_UNKNOWN,
    hold,
    release,
)
from css_common.kernel import kernel
from css_common.schema import Values, real
from css_common.vectors import Vec3, angle_between, dot, norm
from css_estimation.health.gyro_samples import READING_ABSENT, READING_FAILED, READING_JUMPED, check_samples
from css_estimation.health.gyroless_sight import Glimpse, most_across
from css_estimation.health.rate_checks import (
    DEGREES_OF_FREEDOM,
    RateChecks,
    equal_count,
    forget_samples,
    gamma_quantile,
)
from css_estimation.health.slow_value import NOTHING_YET, SlowValue, follow, passed
from css_estimation.sun.sun_heading import Sky

_SIGMAS = 6.0
_NIS_DEGREES = 19.0  # of innovations averaged over ten measurements
_LONGEST_TRIAL = 3600.0  # [s]
_OLDEST_SIGHT = 2.0  # [s]
_MOST_AT_ONCE = 1.0  # [s] that one reading counts for, however long after the last
_EARTH = 3.986004418e14  # [m3/s2]
_FASTEST = math.sqrt(_EARTH / 6.678e6**3)  # [rad/s] of an orbit at 300 km
_STRENGTH_RATE = 1.5  # of the strength: along a polar orbit it doubles within a quarter, times the mean motion
_ANGLE_RATE = 2.0  # the field of a dipole turns by twice the angle of the orbit
# Where a few cells alone see the Sun, the sight may be off by more than it knows.
_SIGHT = math.radians(15.0) ** 2  # [rad^2]
_LEVER = math.radians(10.0)  # the angle of two directions tells little where they are nearly one

NOISE = real("health.field.noise_nt", 100.0, "nT", "white noise of a sample per axis, 1 sigma", low=1e-6, high=1e6)
RESOLUTION = real("health.field.resolution_nt", 30.0, "nT", "step of its output, at most", low=0.0, high=1e6)
ERROR = real(
    "health.field.error_nt", 1000.0, "nT", "lasting error of magnetometer and model, 1 sigma", low=1.0, high=1e6
)
LARGEST = real("health.field.largest_nt", 8e4, "nT", "no field in orbit is stronger", low=1.0, high=1e9)
LEAST = real("health.field.least_nt", 3e3, "nT", "nor weaker", low=0.0, high=1e9)
TURN = real("health.field.turn_deg_s", 20.0, "deg/s", "no faster does the body turn", low=0.1, high=1e4)


def _checks(values: Values) -> RateChecks:
    """Checks of samples, whose largest change per second is that of the strongest field in a turning body."""
    noise, resolution = tesla(values[NOISE]), tesla(values[RESOLUTION])
    return RateChecks(
        noise,
        _SIGMAS * math.sqrt(2.0) * noise + resolution,
        2.0 * noise**2 + resolution**2 / 6.0,
        gamma_quantile(DEGREES_OF_FREEDOM, _SIGMAS),
        equal_count(values[NOISE], values[RESOLUTION]),
        tesla(values[LARGEST]) * math.radians(values[TURN]),
        1.0,
        tesla(values[LARGEST]),
    )


class FieldHealthParameters(NamedTuple):
    """Fields in T, times in s."""

    checks: RateChecks = computed(_checks, NOISE, RESOLUTION, LARGEST, TURN)
    variance: float = made(lambda noise, error: tesla(noise) ** 2 + tesla(error) ** 2, NOISE, ERROR)
    least: float = made(tesla, LEAST)
    threshold: float = given(
        real("health.field.threshold", 36.0, "-", "chi-square beyond which it contradicts the model", low=1.0, high=1e6)
    )
    largest_nis: float = computed(lambda values: gamma_quantile(_NIS_DEGREES, _SIGMAS))
    persistence: float = given(
        real(
            "health.field.persistence",
            3.0,
            "s",
            "contradiction of the model for longer is a failure",
            low=0.0,
            high=1e4,
        )
    )
    return_time: float = given(
        real("health.field.return_time", 60.0, "s", "agreement after which it is used again", low=1.0, high=1e5)
    )
    silence: float = given(
        real("health.field.silence", 30.0, "s", "without a reading for longer it is held for failed", low=0.0, high=1e5)
    )


PARAMETERS = table_of(FieldHealthParameters)


class FieldState(NamedTuple):
    """From cycle to cycle."""

    left: bool
    good_b: Vec3  # [T] last good reading
    since: float  # [s] since the last reading; -1: there has been none
    strength: SlowValue  # [T]
    angle: SlowValue  # [-] cosine of that to the Sun line
    off: float  # [s] for which the model has been contradicted
    agreed: float  # [s] for which nothing has, of one that is left
    trial_time: float  # [s] how long that has to be


def initial_state(p: FieldHealthParameters) -> FieldState:
    """Trusted, nothing read yet."""
    return FieldState(False, (0.0, 0.0, 0.0), -1.0, NOTHING_YET, NOTHING_YET, 0.0, 0.0, 0.5 * p.return_time)


@kernel
def _accuse_all(verdicts, kind: int, evidence: int, statistic: float, threshold: float, step: int) -> None:
    """Of a magnetometer as a whole it is not known which axis fails."""
    for i in range(3):
        if verdicts[i].held == 0:
            hold(verdicts[i], kind, evidence, statistic, threshold, step)


@kernel
def _against_model(p: FieldHealthParameters, field_b: Vec3, sky: Sky, sight: Glimpse) -> tuple[float, float]:
    """Chi-squares (1) of strength and of the angle to the Sun line against the model's; 0 where there is none."""
    strength = norm(sky.field_n)
    if not (sky.known and strength > 0.0):
        return 0.0, 0.0
    off = norm(field_b) - strength
    by_strength = off * off / p.variance
    if not sight.known:
        return by_strength, 0.0
    model = angle_between(sky.field_n, sky.sun_n)
    if min(model, math.pi - model) < _LEVER:
        return by_strength, 0.0
    turned = angle_between(field_b, sight.sun_b) - model
    variance = p.variance / (strength * strength) + most_across(sight.covariance) + _SIGHT
    return by_strength, turned * turned / variance


@kernel
def check_field(
    p: FieldHealthParameters,
    state: FieldState,
    axes,
    verdicts,
    dt: float,
    step: int,
    field_b: Vec3,
    valid: bool,
    sky: Sky,
    sight: Glimpse,
) -> tuple[FieldState, Vec3, bool, bool]:
    """One cycle.

    Args:
        axes: (3,) of GYRO_AXIS, advanced.
        verdicts: (3,) of VERDICT, one an axis.
        dt: [s] since the last cycle.
        step: number of the cycle.
        field_b, valid: the reading [T], and whether one came in this very cycle.
        sky: of the flight's models.
        sight: the Sun by the cells alone.

    Returns:
        State; reading to go on with [T]; whether there is one; whether the magnetometer is left.
    """
    since = state.since + dt if state.since >= 0.0 else state.since
    # it is that of the last cycle, and the body turns
    sight = Glimpse(sight.sun_b, sight.covariance, sight.known and dt <= _OLDEST_SIGHT)
    if not valid:
        silent = since > p.silence and state.since <= p.silence
        if silent:
            _accuse_all(verdicts, KIND_SILENT, EVIDENCE_DEAD, since, p.silence, step)
        return _with(state, state.left or silent, since, state.good_b), field_b, False, state.left or silent
    interval = since if since > 0.0 else dt
    if since > p.silence:
        for i in range(3):
            forget_samples(axes[i])
    good_b, reading = check_samples(p.checks, axes, verdicts, interval, step, field_b, (0.0, 0.0, 0.0))
    spike = good_b[0] != field_b[0] or good_b[1] != field_b[1] or good_b[2] != field_b[2]
    if reading == READING_ABSENT or (spike and reading != READING_FAILED):
        # one sample that cannot be: as if none had come
        return _with(state, state.left, 0.0, state.good_b), field_b, False, state.left
    failed = reading in (READING_FAILED, READING_JUMPED)
    if reading == READING_JUMPED:
        for i in range(3):
            if axes[i].jumped != 0 and verdicts[i].held == 0:
                hold(verdicts[i], KIND_BIAS, EVIDENCE_NOISE, abs(axes[i].jump), p.checks.gate, step)
    size = norm(good_b)
    strength, angle, off = state.strength, state.angle, state.off
    if not failed:
        by_strength, by_angle = _against_model(p, good_b, sky, sight)
        weak = not size > p.least
        contradicted = weak or by_strength > p.threshold or by_angle > p.threshold
        off = off + min(interval, _MOST_AT_ONCE) if contradicted else 0.0
        by_orbit = _STRENGTH_RATE * _FASTEST * size
        strength = follow(passed(strength, interval, by_orbit, _FASTEST), size, p.variance, by_orbit)
        angle = passed(angle, interval, _ANGLE_RATE * _FASTEST, _FASTEST)
        if sight.known and size > 0.0:
            # of the angle itself the change would have a kink where the two directions meet
            cosine = dot(good_b, sight.sun_b) / size
            spread = p.variance / (size * size) + most_across(sight.covariance) + _SIGHT
            variance = max(1.0 - cosine * cosine, 0.0) * spread + 0.5 * spread * spread
            angle = follow(angle, cosine, variance, _ANGLE_RATE * _FASTEST)
        if off > p.persistence:
            failed = True
            by_sun = by_angle > by_strength and not weak
            evidence = EVIDENCE_SUN if by_sun else EVIDENCE_FIELD
            _accuse_all(verdicts, KIND_UNKNOWN, evidence, max(by_strength, by_angle), p.threshold, step)
        elif strength.nis > p.largest_nis:
            failed = True
            _accuse_all(verdicts, KIND_UNKNOWN, EVIDENCE_FIELD, strength.nis, p.largest_nis, step)
        elif angle.nis > p.largest_nis:
            failed = True
            _accuse_all(verdicts, KIND_UNKNOWN, EVIDENCE_SUN, angle.nis, p.largest_nis, step)
    if failed:
        longer = state.trial_time if state.left else min(2.0 * state.trial_time, _LONGEST_TRIAL)
        return FieldState(True, good_b, 0.0, NOTHING_YET, NOTHING_YET, 0.0, 0.0, longer), good_b, False, True
    agreed = state.agreed + interval if state.left else 0.0
    left = state.left and agreed < state.trial_time
    if state.left and not left:
        for i in range(3):
            if verdicts[i].held != 0:
                release(verdicts[i])
    return FieldState(left, good_b, 0.0, strength, angle, off, agreed, state.trial_time), good_b, not left, left


@kernel
def _with(state: FieldState, left: bool, since: float, good_b: Vec3) -> FieldState:
    return FieldState(left, good_b, since, state.strength, state.angle, state.off, state.agreed, state.trial_time)
