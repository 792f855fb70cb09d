# SPDX-License-Identifier: Apache-2.0
"""Attitude of a spinning body at the instant of a Sun measurement, from Sun and interpolated field by TRIAD."""

from typing import NamedTuple

from css_common.declared import builder, made, table_of
from css_common.kernel import kernel
from css_common.schema import choice
from css_common.vectors import Mat3, Vec3, add, angle_between, dot, norm, scale, subtract, unit
from css_estimation.attitude.triad import triad, triad_covariance_of
from css_estimation.symmetric import Symmetric, isotropic, product, trace

MODE_NONE = 0
MODE_SUN_FIRST = 1
MODE_FIELD_FIRST = 2

ORDER_BEST = 0
ORDER_SUN = 1
ORDER_FIELD = 2
"""Which direction is the primary one: that which leaves the smaller covariance, or always the same."""

_ORDERS = ("best", "sun", "field")


class TriadParameters(NamedTuple):
    """What is chosen of TRIAD."""

    order: int = made(  # ORDER_*
        _ORDERS.index,
        choice("primary", "best", _ORDERS, "first direction of TRIAD; best: that with the smaller covariance"),
    )


PARAMETERS = table_of(TriadParameters)
parameters = builder(TriadParameters)


class SunFieldAttitude(NamedTuple):
    """Attitude of one instant; MODE_NONE when the directions fix none."""

    mode: int
    dcm_bn: Mat3
    covariance: Symmetric  # of the attitude error, rotation vector in b [rad^2]
    nis: float  # of the angle between the directions, one degree of freedom


@kernel
def interpolated_field(f0: Vec3, f1: Vec3, f2: Vec3, f3: Vec3, u: float) -> Vec3:
    """Field at a fraction `u` of the way from f1 to f2, of four equidistant samples, by the cubic through them."""
    w0, w1, w2, w3 = interpolation_weights(u)
    return add(add(scale(w0, f0), scale(w1, f1)), add(scale(w2, f2), scale(w3, f3)))


@kernel
def interpolation_weights(u: float) -> tuple[float, float, float, float]:
    """Weights of four equidistant samples for the cubic through them, `u` of the way from the second to the third."""
    return (
        -u * (u - 1.0) * (u - 2.0) / 6.0,
        (u + 1.0) * (u - 1.0) * (u - 2.0) / 2.0,
        -(u + 1.0) * u * (u - 2.0) / 2.0,
        (u + 1.0) * u * (u - 1.0) / 6.0,
    )


@kernel
def interpolated_variance(variance: float, strength: float, turn: float, u: float) -> float:
    """Variance of each component of the interpolated field: noise of the samples, and what a cubic misses of a turn.

    Args:
        variance: of each component of a sample [T^2].
        strength: of the field [T].
        turn: of the body from sample to sample [rad].
    """
    w0, w1, w2, w3 = interpolation_weights(u)
    missed = strength * turn**4 * (u + 1.0) * u * (1.0 - u) * (2.0 - u) / 24.0
    return variance * (w0 * w0 + w1 * w1 + w2 * w2 + w3 * w3) + 0.5 * missed * missed


@kernel
def sun_field_attitude(
    sun_b: Vec3, sun_covariance: Symmetric, field_b: Vec3, field_variance: float, sun_n: Vec3, field_n: Vec3, order: int
) -> SunFieldAttitude:
    """TRIAD of Sun and field.

    Args:
        sun_b: measured unit vector to the Sun, with its covariance.
        field_b: measured field [T], with the variance of each component [T^2].
        sun_n, field_n: from models.
        order: ORDER_*.
    """
    strength = norm(field_b)
    nothing = SunFieldAttitude(MODE_NONE, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), isotropic(0.0), 0.0)
    if not strength > 0.0:
        return nothing
    along_b, along_n = scale(1.0 / strength, field_b), unit(field_n)
    variance = field_variance / (strength * strength)
    ok, sun_first = triad(sun_b, along_b, sun_n, along_n)
    if not ok:
        return nothing
    _, field_first = triad(along_b, sun_b, along_n, sun_n)
    of_sun = triad_covariance_of(sun_b, along_b, sun_covariance, isotropic(variance))
    of_field = triad_covariance_of(along_b, sun_b, isotropic(variance), sun_covariance)
    towards = unit(subtract(along_b, scale(dot(along_b, sun_b), sun_b)))
    off = angle_between(sun_b, along_b) - angle_between(sun_n, along_n)
    nis = off * off / (dot(towards, product(sun_covariance, towards)) + variance)
    if order == ORDER_FIELD or (order == ORDER_BEST and trace(of_field) < trace(of_sun)):
        return SunFieldAttitude(MODE_FIELD_FIRST, field_first, of_field, nis)
    return SunFieldAttitude(MODE_SUN_FIRST, sun_first, of_sun, nis)


@kernel
def measured_attitude(
    p: TriadParameters,
    sun_b: Vec3,
    sun_covariance: Symmetric,
    field_b: Vec3,
    field_variance: float,
    sun_n: Vec3,
    field_n: Vec3,
) -> SunFieldAttitude:
    """TRIAD of Sun and field, as `sun_field_attitude`, of parameters.

    Args:
        sun_b: measured unit vector to the Sun
        sun_covariance: of it, upper triangle by rows
        field_b: [T] measured field at the same instant
        field_variance: [T^2] of each component
        sun_n: unit vector to the Sun from a model
        field_n: [T] field from a model
    """
    return sun_field_attitude(sun_b, sun_covariance, field_b, field_variance, sun_n, field_n, p.order)
