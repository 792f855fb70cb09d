# SPDX-License-Identifier: Apache-2.0
"""Direction of the magnetic field as a measurement of attitude.

Only the two components across the predicted field tell attitude (Crassidis & Junkins, section 6.2: H = [b x]). The one
along it is a matter of the field model and the magnetometer: where their errors are states (`slow_errors`), it measures
them whatever the attitude.
"""

from css_common.kernel import kernel
from css_common.vectors import (
    Mat3,
    Vec3,
    add,
    axes_across,
    cross,
    dot,
    multiply,
    multiply_transposed,
    norm,
    scale,
    subtract,
)
from css_estimation.attitude.direction_measurement import DirectionMeasurement, attitude_rows, no_direction
from css_estimation.attitude.slow_errors import FIELD, MAGNETOMETER
from css_estimation.sun.error_covariance import Block, Partials

WEAKEST, STRONGEST = 1e-6, 1e-3
"""Fields [T] outside of these are none of the Earth's in orbit."""


@kernel
def plausible_field(field: Vec3) -> bool:
    """True for a field [T] that the Earth has; a NaN is none."""
    strength = norm(field)
    return WEAKEST < strength < STRONGEST


@kernel
def field_measurement(field_b: Vec3, predicted_b: Vec3, variance: float) -> DirectionMeasurement:
    """Measured field against the predicted one, both in b [T]; `variance` [T^2] of each component."""
    if not (plausible_field(field_b) and plausible_field(predicted_b)):
        return no_direction()
    inverse = 1.0 / norm(predicted_b)
    direction = scale(inverse, predicted_b)
    across_1, across_2 = axes_across(direction)
    residual = subtract(scale(inverse, field_b), direction)
    return DirectionMeasurement(
        attitude_rows(cross(across_1, direction), cross(across_2, direction), (0.0, 0.0, 0.0)),
        (dot(across_1, residual), dot(across_2, residual), 0.0),
        variance * inverse * inverse,
        2,
    )


@kernel
def biased_field_measurement(
    field_b: Vec3, dcm_bn: Mat3, field_n: Vec3, bias_b: Vec3, variance: float
) -> DirectionMeasurement:
    """Measured field against A field_n + bias, where magnetometer and model err lastingly (`slow_errors`).

    Args:
        field_b: measured [T].
        field_n: model with its estimated error [T].
        bias_b: of the magnetometer, estimated [T].
        variance: of the white error of each component [T^2].
    """
    turned_b = multiply(dcm_bn, field_n)
    predicted_b = add(turned_b, bias_b)
    if not (plausible_field(field_b) and plausible_field(predicted_b)):
        return no_direction()
    inverse = 1.0 / norm(predicted_b)
    along = scale(inverse, predicted_b)
    across_1, across_2 = axes_across(along)
    residual = scale(inverse, subtract(field_b, predicted_b))
    return DirectionMeasurement(
        (
            _component(across_1, inverse, turned_b, dcm_bn),
            _component(across_2, inverse, turned_b, dcm_bn),
            _component(along, inverse, turned_b, dcm_bn),
        ),
        (dot(across_1, residual), dot(across_2, residual), dot(along, residual)),
        variance * inverse * inverse,
        3,
    )


@kernel
def _component(axis_b: Vec3, inverse: float, turned_b: Vec3, dcm_bn: Mat3) -> Partials:
    """Derivatives of the predicted field's component along an axis, times `inverse`."""
    u = scale(inverse, axis_b)
    return Partials(cross(u, turned_b), Block(MAGNETOMETER, 3, u), Block(FIELD, 3, multiply_transposed(dcm_bn, u)))
