# SPDX-License-Identifier: Apache-2.0
"""Direction of the magnetic field as a measurement of attitude.

Only the two components across the predicted field tell attitude (Crassidis & Junkins, section 6.2: H = [b x]); the
one along it is a matter of the field model and the magnetometer's scale.
"""

from css_common.kernel import kernel
from css_common.vectors import Vec3, axes_across, cross, dot, norm, scale, subtract
from css_estimation.attitude.direction_measurement import DirectionMeasurement, no_direction

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
        (cross(across_1, direction), cross(across_2, direction), (0.0, 0.0, 0.0)),
        (dot(across_1, residual), dot(across_2, residual), 0.0),
        variance * inverse * inverse,
        2,
    )
