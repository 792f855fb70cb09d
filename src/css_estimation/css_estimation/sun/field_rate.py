# SPDX-License-Identifier: Apache-2.0
"""Body rate from the geomagnetic field, where no gyro measures it (Benton, Clark safe-hold).

The Sun vectors leave the rate about the Sun line open; the field closes it, as it turns with the body about any line
but its own. Without Sun the field alone gives the two axes across itself. To both the field counts as inertially
fixed: along the orbit it turns by twice the orbital rate, 0.13 deg/s at most, and that much the rate is wrong.
"""

from typing import NamedTuple

from css_common.conversions import sine_of_degrees
from css_common.declared import builder, given, made, table_of
from css_common.kernel import kernel
from css_common.schema import flag, real
from css_common.vectors import Vec3, add, cross, dot, norm, scale, subtract, unit
from css_estimation.sun.low_pass import low_pass, low_pass_gain
from css_estimation.sun.sun_heading import Aiding
from css_estimation.sun.sun_rate import rate_from_sun_vectors

_SMALLEST_FIELD = 1e-9  # [T]
_LARGEST_FIELD = 1.0  # [T]

USE_FIELD = flag("rate.use_field", False, "without gyro, take from the magnetic field what the Sun vectors leave open")


class FieldRateParameters(NamedTuple):
    """How the field is used."""

    use_field: bool = given(USE_FIELD)
    cutoff: float = given(
        real("rate.field_cutoff", 0.1, "Hz", "corner of the low-pass on a field-derived rate", low=0.0, high=1e3)
    )
    smallest_sine: float = made(  # of the angle from field to Sun line
        sine_of_degrees,
        real(
            "rate.field_angle_deg",
            15.0,
            "deg",
            "no rate about the Sun line from a field so near it",
            low=1.0,
            high=89.0,
        ),
    )
    hold: float = given(
        real("rate.field_hold", 10.0, "s", "how long the last field and the rate from it are good", low=0.0, high=1e4)
    )


PARAMETERS = table_of(FieldRateParameters)
parameters = builder(FieldRateParameters)


class FieldTrack(NamedTuple):
    """Carried from cycle to cycle."""

    field_b: Vec3  # [T] last measurement
    since: float  # [s] since it was taken; -1: none that is good
    age: float  # [s] since the field gave a rate; -1: it has not, or too long ago


class FieldChange(NamedTuple):
    """Two successive measurements of the field."""

    known: bool
    field_b: Vec3  # [T] the later
    previous_b: Vec3  # [T]
    interval: float  # [s]


def initial_state() -> FieldTrack:
    """Nothing measured."""
    return FieldTrack((0.0, 0.0, 0.0), -1.0, -1.0)


@kernel
def track_field(p: FieldRateParameters, track: FieldTrack, dt: float, aiding: Aiding) -> tuple[FieldTrack, FieldChange]:
    """The track after one cycle of `dt` [s], and what the field has done since its last measurement."""
    if not p.use_field:
        return track, FieldChange(False, track.field_b, track.field_b, 0.0)
    since = track.since + dt if track.since >= 0.0 else -1.0
    age = track.age + dt if track.age >= 0.0 else -1.0
    if age > p.hold:
        age = -1.0
    size = norm(aiding.field_b)
    if aiding.field_valid and _SMALLEST_FIELD < size < _LARGEST_FIELD:
        change = FieldChange(0.0 < since <= p.hold, aiding.field_b, track.field_b, since)
        return FieldTrack(aiding.field_b, 0.0, age), change
    if since > p.hold:
        since = -1.0
    return FieldTrack(track.field_b, since, age), FieldChange(False, track.field_b, track.field_b, 0.0)


@kernel
def rate_about_sun(sun_b: Vec3, omega_across_b: Vec3, change: FieldChange, smallest_sine: float) -> tuple[float, bool]:
    """Rate about the Sun line [rad/s], and whether the field tells it.

    In the body frame a fixed field changes by B' = B x omega. With omega = omega_across + w s this is
    B' + omega_across x B = -w s x B, and w = -(s x B).(B' + omega_across x B) / |s x B|^2.

    Args:
        sun_b: unit vector.
        omega_across_b: rate across the Sun line [rad/s].
        change: two measurements; the field is taken at the middle of their interval.
        smallest_sine: of the angle from field to Sun line; below it there is no answer.
    """
    field_b = scale(0.5, add(change.field_b, change.previous_b))
    lever = cross(sun_b, field_b)
    square = dot(lever, lever)
    if not square > smallest_sine * smallest_sine * dot(field_b, field_b):
        return 0.0, False
    field_rate = scale(1.0 / change.interval, subtract(change.field_b, change.previous_b))
    return -dot(lever, add(field_rate, cross(omega_across_b, field_b))) / square, True


@kernel
def filter_with_sun(
    p: FieldRateParameters,
    track: FieldTrack,
    change: FieldChange,
    sun_b: Vec3,
    omega_bn_b: Vec3,
    sun_rate_b: Vec3,
    gain: float,
    limit: float,
) -> tuple[FieldTrack, Vec3]:
    """Filtered rate after one cycle: across the Sun line from the Sun vectors, about it from the field.

    Between measurements, and while the field lies along the Sun line, the rate about it stands for as long as
    `rate.field_hold` allows; then it decays, for nothing is known of it.

    Args:
        omega_bn_b: filtered rate before [rad/s].
        sun_rate_b: rate from the last two Sun vectors [rad/s].
        gain: of the low-pass for it.
        limit: bound on the rate about the Sun line [rad/s].
    """
    about = dot(omega_bn_b, sun_b)
    across_b = low_pass(subtract(omega_bn_b, scale(about, sun_b)), sun_rate_b, gain)
    if change.known:
        measured, known = rate_about_sun(sun_b, across_b, change, p.smallest_sine)
        if known:
            measured = min(max(measured, -limit), limit)
            about += low_pass_gain(p.cutoff, change.interval) * (measured - about)
            track = FieldTrack(track.field_b, track.since, 0.0)
    if track.age < 0.0:
        about -= gain * about
    return track, add(across_b, scale(about, sun_b))


@kernel
def filter_without_sun(
    p: FieldRateParameters, track: FieldTrack, change: FieldChange, omega_bn_b: Vec3, limit: float
) -> tuple[FieldTrack, Vec3]:
    """Filtered rate after one cycle in the dark: across the field from its turning, about the field going to zero.

    Nothing is known about the field's own line. A rate held there would keep a rate damping at work on an error that
    its action never shows in, and spin the body up.
    """
    if not change.known:
        return track, omega_bn_b
    field_b, previous_b = unit(change.field_b), unit(change.previous_b)
    # a fixed direction like that of the Sun, so Eq. 15 of O'Keefe & Schaub holds for it
    measured = rate_from_sun_vectors(field_b, previous_b, change.interval, limit)
    omega_bn_b = low_pass(omega_bn_b, measured, low_pass_gain(p.cutoff, change.interval))
    return FieldTrack(track.field_b, track.since, 0.0), omega_bn_b
