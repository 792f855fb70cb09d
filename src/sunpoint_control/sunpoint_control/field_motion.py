# SPDX-License-Identifier: Apache-2.0
"""How the magnetic field turns in the body, and the body rate that it tells without a gyro.

A field that stands still in inertial space turns in the body as b' = b x omega, b = B/|B|. Two measurements give

* the derivative b', their difference over the time between them: the B-dot of magnetic detumbling, as it is;
* the rate across the field, b' x b. The rate about the field line does not show in it.

The whole rate shows in time, as the field goes round in the body. An observer keeps it: between measurements the rate
follows Euler's equation under the torque of the rods, and turns the last direction of the field with it; the angle by
which the next one misses that is the error of the rate across the field, of which a share is taken over. So an
even spin about any axis is known without lag. A running mean of b' is not: it lags by an angle of the spin, and a
control that feeds it back pushes steadily beside its aim.

Along the orbit the field itself turns, by twice the orbital rate on average, 0.13 deg/s at most: that much the rate is
wrong. A measurement that is missing or no number is passed over; after a gap all begins anew.
"""

from typing import NamedTuple

from css_common.attitude import rotation_vector_to_dcm
from css_common.declared import builder, computed, given, table_of
from css_common.kernel import kernel
from css_common.matrices import inverse
from css_common.schema import Values, real
from css_common.vectors import Mat3, Vec3, add, cross, mat3, multiply, norm, scale, subtract, unit
from sunpoint_control.held_field import HeldField
from sunpoint_control.plausible import LARGEST_FIELD, LARGEST_RATE, within
from sunpoint_control.torque_rods import NO_FIELD

_ZERO: Vec3 = (0.0, 0.0, 0.0)


def _inertia(values: Values) -> Mat3:
    return mat3(values.spacecraft.inertia)


def _inertia_inverse(values: Values) -> Mat3:
    return inverse(_inertia(values))


class FieldMotionParameters(NamedTuple):
    """The observer, and the body that it follows."""

    gain: float = given(
        real(
            "field.gain",
            0.1,
            "-",
            "share of the rate error that a measurement of the field shows which the rate takes over",
            low=0.0,
            open_low=True,
            high=1.0,
            tunable=True,
        )
    )
    longest_gap: float = given(
        real(
            "field.longest_gap",
            5.0,
            "s",
            "time between two measurements beyond which they make no pair",
            low=0.0,
            open_low=True,
            high=100.0,
        )
    )
    inertia_b: Mat3 = computed(_inertia)  # [kg m^2]
    inertia_inverse_b: Mat3 = computed(_inertia_inverse)


PARAMETERS = table_of(FieldMotionParameters)
parameters = builder(FieldMotionParameters)


class FieldMotion(NamedTuple):
    """Carried from cycle to cycle."""

    measured_b: Vec3  # unit vector of the last measurement; zeros: none
    turned_b: Vec3  # the same, turned with the rate since
    size: float  # [T] of the last measurement
    since: float  # [s] since then
    derivative_b: Vec3  # [1/s] b', of the last pair
    omega_bn_b: Vec3  # [rad/s]
    known: bool  # there was a pair


def initial_state() -> FieldMotion:
    """No field measured yet."""
    return FieldMotion(_ZERO, _ZERO, 0.0, 0.0, _ZERO, _ZERO, False)


@kernel
def usable(field: HeldField) -> bool:
    """Whether there is a field, and it is one."""
    return field.valid and within(field.field_b, LARGEST_FIELD) and norm(field.field_b) > NO_FIELD


@kernel
def _turned(p: FieldMotionParameters, motion: FieldMotion, dt: float, torque_b: Vec3) -> FieldMotion:
    """Rate and direction of the field after `dt` [s] without a measurement."""
    since = motion.since + dt
    if not motion.known or since > p.longest_gap:
        return FieldMotion(motion.measured_b, motion.measured_b, motion.size, since, _ZERO, _ZERO, False)
    turned_b = unit(multiply(rotation_vector_to_dcm(scale(dt, motion.omega_bn_b)), motion.turned_b))
    gyroscopic_b = cross(motion.omega_bn_b, multiply(p.inertia_b, motion.omega_bn_b))
    change_b = multiply(p.inertia_inverse_b, subtract(torque_b, gyroscopic_b))
    omega_bn_b = add(motion.omega_bn_b, scale(dt, change_b))
    # a rate beyond reason is lost, and begins anew with the next pair
    known = within(omega_bn_b, LARGEST_RATE)
    return FieldMotion(motion.measured_b, turned_b, motion.size, since, motion.derivative_b, omega_bn_b, known)


@kernel
def follow_field(
    p: FieldMotionParameters, motion: FieldMotion, dt: float, field: HeldField, torque_b: Vec3
) -> FieldMotion:
    """Motion of the field after one cycle.

    Args:
        dt: length of the cycle [s].
        torque_b: of the rods on the body in that time [N m].
    """
    motion = _turned(p, motion, dt, torque_b)
    if not (field.fresh and usable(field)):
        return motion
    size = norm(field.field_b)
    b = scale(1.0 / size, field.field_b)
    if not 0.0 < motion.since <= p.longest_gap or norm(motion.measured_b) == 0.0:
        return FieldMotion(b, b, size, 0.0, _ZERO, _ZERO, False)
    derivative_b = scale(1.0 / motion.since, subtract(b, motion.measured_b))
    if motion.known:
        # from b back to where it was expected, as an inertially fixed direction goes in a body that turns
        error_b = scale(1.0 / motion.since, cross(b, motion.turned_b))
        omega_bn_b = add(motion.omega_bn_b, scale(p.gain, error_b))
    else:
        omega_bn_b = cross(derivative_b, unit(add(b, motion.measured_b)))
    return FieldMotion(b, b, size, 0.0, derivative_b, omega_bn_b, True)


@kernel
def field_now(motion: FieldMotion) -> Vec3:
    """Field in b [T] at the end of the cycle, the last measurement turned with the body rate since."""
    return scale(motion.size, motion.turned_b)
