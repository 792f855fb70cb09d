# SPDX-License-Identifier: Apache-2.0
"""What the measured magnetic field says about the attitude of the Sun filter, where the orbit tells the field.

Its direction gives two numbers across itself, and with them the turn about the Sun line that cells do not see. Bias of
the magnetometer and error of the model last: a component that the state knows better than they allow is left alone, so
that they are not averaged away (a lasting error is no noise).
"""

from typing import NamedTuple

from css_common.kernel import kernel
from css_common.vectors import (
    Vec3,
    axes_across,
    cross,
    dot,
    multiply,
    multiply_transposed,
    norm,
    scale,
    subtract,
)
from css_estimation.attitude.field_direction import plausible_field
from css_estimation.sun.sun_heading import Aiding
from css_estimation.sun_filter.calibration import corrected_states
from css_estimation.sun_filter.cell_update import absorb, correct
from css_estimation.sun_filter.memory import THETA, SunFilterMemory, dcm_of, quadratic
from css_estimation.sun_filter.options import SunFilterParameters


class FieldReading(NamedTuple):
    """What the filter made of a measured field."""

    likelihood: float  # logarithm, but for a constant
    used: int  # numbers that corrected the state
    refused: bool


@kernel
def field_usable(p: SunFilterParameters, aiding: Aiding) -> bool:
    """True when there is a measurement of this cycle and a model to compare it with."""
    measured = p.field.use_field and aiding.field_valid and plausible_field(aiding.field_b)
    return measured and aiding.sky.known and plausible_field(aiding.sky.field_n)


@kernel
def read_field(
    p: SunFilterParameters, field_b: Vec3, field_n: Vec3, learns: bool, states: int, x, covariance, m: SunFilterMemory
) -> FieldReading:
    """Updates an estimate with a measured field [T].

    Args:
        field_n: of the model [T].
        learns: the states of calibration are corrected.
        states: how many of the states are in use.
        m: room.
    """
    dcm_bn = dcm_of(x)
    inverse = 1.0 / norm(field_n)
    along_b = scale(inverse, multiply(dcm_bn, field_n))
    along_n = scale(inverse, field_n)
    residual = subtract(scale(1.0 / norm(field_b), field_b), along_b)
    lasting = p.field.lasting * inverse * inverse
    noise = p.field.noise * inverse * inverse + lasting
    corrected = corrected_states(p.cells.shape[0], states, learns)
    gained, correction = m.work[0], m.work[1]
    for j in range(states):
        correction[j] = 0.0
    likelihood, used, refused = 0.0, 0, False
    for axis_b in axes_across(along_b):
        # d(a . A f) = d(a_n) . f with d(a_n) = theta x a_n
        by_theta = cross(multiply_transposed(dcm_bn, axis_b), along_n)
        innovation = dot(axis_b, residual)
        innovation -= by_theta[0] * correction[0] + by_theta[1] * correction[1] + by_theta[2] * correction[2]
        known = quadratic(covariance, THETA, by_theta)
        squared = innovation * innovation / (known + noise)
        likelihood -= 0.5 * min(squared, p.convergence.gate)
        if squared > p.convergence.gate:
            refused = True
            continue
        if known < lasting:
            continue
        used += 1
        for j in range(states):
            gained[j] = by_theta[0] * covariance[j, 0] + by_theta[1] * covariance[j, 1] + by_theta[2] * covariance[j, 2]
        absorb(gained, innovation, known + noise, corrected, states, correction, covariance)
    correct(p, x, correction, states)
    return FieldReading(likelihood, used, refused)
