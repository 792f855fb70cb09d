# SPDX-License-Identifier: Apache-2.0
"""What every Sun estimator does around its own estimate: body rate, eclipse, age and validity.

An estimator makes an `Estimate` from the cells and hands it to `finish_cycle`.

Body rate. While the gyro delivers and may be used, its rate goes through the low-pass filter; otherwise the
rate of two successive Sun vectors does (O'Keefe & Schaub 2013, Eq. 15). Both feed one filter state, so the
reported rate is continuous when the gyro is switched off or on in flight: it moves to the new source with
the time constant of the filter. Where the magnetic field is measured and may be used it fills in what the Sun vectors
leave open (`field_rate`). Two vectors make a pair only when cells gave both in successive cycles; the
vector from before an eclipse, or from before an estimator started anew, is never half of one. Without gyro
or field and without a pair there is no information: the filter holds, or decays to zero, and the rate source
says so. Vectors of a Sun that sets make no pair, and what they made before it was noticed is not held (`fading`).
"""

import math
from typing import NamedTuple

from css_common.attitude import rotation_vector_to_dcm
from css_common.declared import builder, given, made, part, table_of
from css_common.kernel import kernel
from css_common.schema import choice, flag, real
from css_common.vectors import Vec3, multiply, scale, unit
from css_estimation.sun import eclipse_detector, fading, field_rate
from css_estimation.sun.eclipse_detector import EclipseParameters, EclipseState, goes_by_model
from css_estimation.sun.fading import LightNow, LightTrack, follow_light, in_the_dark
from css_estimation.sun.field_rate import (
    FieldRateParameters,
    FieldTrack,
    filter_with_sun,
    filter_without_sun,
    track_field,
)
from css_estimation.sun.low_pass import low_pass, low_pass_gain
from css_estimation.sun.sun_heading import (
    RATE_FIELD,
    RATE_GYRO,
    RATE_NONE,
    RATE_SUN,
    VALIDITY_HELD,
    VALIDITY_NONE,
    VALIDITY_VALID,
    Aiding,
    Covariance,
    SunHeading,
)
from css_estimation.sun.sun_rate import rate_from_sun_vectors

_LONGEST_STEP = 1e9  # [s]
# Stamps are whole nanoseconds. What is divided by a far shorter step overflows.
_SHORTEST_STEP = 1e-12  # [s]

RATE_CUTOFF = real("rate.cutoff", 0.1, "Hz", "corner of the first-order low-pass on the rate", low=0.0, high=1e3)
USE_GYRO = flag("use_gyro", True, "use the gyro while it delivers; off: rates from Sun vectors", tunable=True)
GYRO_LIMIT = real("rate.gyro_limit_deg_s", 300.0, "deg/s", "a gyro reading beyond it is not used", low=0.0, high=1e4)


class TrackingParameters(NamedTuple):
    """Rates in rad/s."""

    use_gyro: bool = given(USE_GYRO)
    cutoff: float = given(RATE_CUTOFF)
    rate_limit: float = made(
        math.radians,
        real("rate.limit_deg_s", 10.0, "deg/s", "bound on each axis of a Sun-derived rate", low=0.0, high=360.0),
    )
    gyro_limit: float = made(math.radians, GYRO_LIMIT)
    hold_rate: bool = made(
        lambda word: word == "hold",
        choice("rate.without_information", "hold", ("hold", "zero"), "filtered rate while none is measured"),
    )
    field: FieldRateParameters = part(FieldRateParameters)
    eclipse: EclipseParameters = part(EclipseParameters)


PARAMETERS = table_of(TrackingParameters)
parameters = builder(TrackingParameters)


class TrackingState(NamedTuple):
    """Carried from cycle to cycle."""

    sun_b: Vec3  # last estimate
    omega_bn_b: Vec3  # filtered rate
    age: float
    validity: int
    rate_source: int
    field: FieldTrack
    eclipse: EclipseState
    light: LightTrack


class Estimate(NamedTuple):
    """What an estimator made of one cycle."""

    sun_b: Vec3  # unit vector; zeros: none yet
    covariance: Covariance
    valid: bool  # cells of this cycle contributed
    stands_in: bool  # sun_b is no estimate, nor one that is held
    restarted: bool  # not a continuation of the last vector: the two are no pair for a rate
    nis: float
    nis_dof: int
    lit_mask: int
    mode: int
    light: LightTrack


def initial_state() -> TrackingState:
    """No estimate yet, filter at rest."""
    zero = (0.0, 0.0, 0.0)
    return TrackingState(
        zero,
        zero,
        0.0,
        VALIDITY_NONE,
        RATE_NONE,
        field_rate.initial_state(),
        eclipse_detector.initial_state(),
        fading.initial_track(),
    )


@kernel
def elapsed(dt: float) -> float:
    """The step [s], 0 for one that is negative, absurd or no number: time that cannot be trusted has not passed."""
    return dt if _SHORTEST_STEP <= dt < _LONGEST_STEP else 0.0


@kernel
def is_body_rate(gyro_b: Vec3, limit: float) -> bool:
    """True when what a gyro says [rad/s] is a number on each axis, and not beyond a limit."""
    # a NaN compares false
    return abs(gyro_b[0]) <= limit and abs(gyro_b[1]) <= limit and abs(gyro_b[2]) <= limit


@kernel
def gyro_usable(p: TrackingParameters, aiding: Aiding) -> bool:
    """True when the gyro may be used and its reading is one."""
    return p.use_gyro and aiding.gyro_valid and is_body_rate(aiding.gyro_b, p.gyro_limit)


@kernel
def turned_sun(sun_b: Vec3, omega_bn_b: Vec3, dt: float) -> Vec3:
    """Components in b of an inertially fixed direction after `dt` [s] at constant rate [rad/s]."""
    return unit(multiply(rotation_vector_to_dcm(scale(dt, omega_bn_b)), sun_b))


@kernel
def watch_light(
    p: TrackingParameters, state: TrackingState, dt: float, aiding: Aiding, lit: bool, now: LightNow
) -> tuple[LightTrack, bool]:
    """The track of the light, and whether the Sun is setting: no cell's output is to be taken for a direction.

    Args:
        lit: cells see a Sun, setting or not.
        now: what the estimator can tell of the light.
    """
    if not lit:
        return in_the_dark(state.light, gyro_usable(p, aiding)), False
    if goes_by_model(p.eclipse, aiding.sky):
        # of the light the model alone says whether all of the Sun is in view
        setting = aiding.sky.illumination < 1.0
        return LightTrack(1.0, 1.0 if setting else 0.0, 0.0), setting
    return follow_light(state.light, dt, now)


@kernel
def makes_pair(state: TrackingState, dt: float, gyro_ok: bool, estimate: Estimate) -> bool:
    """Whether the body rate follows from the last Sun vector and this one."""
    return not gyro_ok and estimate.valid and not estimate.restarted and state.validity == VALIDITY_VALID and dt > 0.0


@kernel
def finish_cycle(
    p: TrackingParameters,
    state: TrackingState,
    dt: float,
    aiding: Aiding,
    gyro_ok: bool,
    shadow: tuple[EclipseState, int],
    estimate: Estimate,
) -> tuple[TrackingState, SunHeading]:
    """Rate, age and validity of this cycle.

    Args:
        dt: `elapsed` time [s].
        gyro_ok: result of `gyro_usable`.
        shadow: result of `detect_eclipse`.
    """
    rate = (0.0, 0.0, 0.0)
    if makes_pair(state, dt, gyro_ok, estimate):
        rate = rate_from_sun_vectors(estimate.sun_b, state.sun_b, dt, p.rate_limit)
    return finish_with_rate(p, state, dt, aiding, gyro_ok, shadow, estimate, rate)


@kernel
def finish_with_rate(
    p: TrackingParameters,
    state: TrackingState,
    dt: float,
    aiding: Aiding,
    gyro_ok: bool,
    shadow: tuple[EclipseState, int],
    estimate: Estimate,
    rate: Vec3,
) -> tuple[TrackingState, SunHeading]:
    """As `finish_cycle`, with the rate across the Sun line [rad/s] that takes the place of the gyro's."""
    eclipse_state, eclipse = shadow
    field, change = track_field(p.field, state.field, dt, aiding)

    omega_bn_b = state.omega_bn_b
    gain = low_pass_gain(p.cutoff, dt)
    rate_source = RATE_NONE
    if gyro_ok:
        rate_source = RATE_GYRO
        omega_bn_b = low_pass(omega_bn_b, aiding.gyro_b, gain)
    elif makes_pair(state, dt, gyro_ok, estimate):
        rate_source = RATE_SUN
        if p.field.use_field:
            field, omega_bn_b = filter_with_sun(
                p.field, field, change, estimate.sun_b, omega_bn_b, rate, gain, p.rate_limit
            )
            if field.age >= 0.0:
                rate_source = RATE_FIELD
        else:
            omega_bn_b = low_pass(omega_bn_b, rate, gain)
    elif p.field.use_field and (change.known or field.age >= 0.0):
        field, omega_bn_b = filter_without_sun(p.field, field, change, omega_bn_b, p.rate_limit)
        rate_source = RATE_FIELD
    elif not p.hold_rate or estimate.light.before > 0.0:
        # what successive vectors showed of a Sun that set was its setting
        omega_bn_b = low_pass(omega_bn_b, (0.0, 0.0, 0.0), gain)

    validity = state.validity
    if estimate.valid:
        validity = VALIDITY_VALID
    elif estimate.stands_in:
        validity = VALIDITY_NONE
    elif validity == VALIDITY_VALID:
        validity = VALIDITY_HELD
    age = 0.0 if estimate.valid or validity == VALIDITY_NONE else state.age + dt

    new_state = TrackingState(
        estimate.sun_b, omega_bn_b, age, validity, rate_source, field, eclipse_state, estimate.light
    )
    heading = SunHeading(
        estimate.sun_b,
        estimate.covariance,
        omega_bn_b,
        age,
        estimate.nis,
        estimate.nis_dof,
        estimate.lit_mask,
        validity,
        rate_source,
        eclipse,
        estimate.mode,
        isolated=0,
        sensors_left=0,
    )
    return new_state, heading
