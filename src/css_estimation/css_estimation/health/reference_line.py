# SPDX-License-Identifier: Apache-2.0
"""What an error of the gyro does to a vector that is carried along with its rate.

A vector that nothing turns in n (the Sun line, the angular momentum) has v' = v x omega in b. Carried along with a
gyro that reads g = omega + e, it falls behind the measured one by a difference d with

    d' = -[g x] d - [v x] e,

which is linear in e: d = F b for an error that is constant, d = G c for one that is proportional to what each axis
reads, e = diag(g) c. Both matrices are carried along over a block of cycles, at the end of which d is measured.
"""

from typing import NamedTuple

from css_common.attitude import rotation_vector_to_dcm
from css_common.kernel import kernel
from css_common.matrices import IDENTITY, scaled, skew, sum_of
from css_common.vectors import Mat3, Vec3, add, matmul, multiply, norm, scale, subtract

NO_MATRIX: Mat3 = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


class Line(NamedTuple):
    """A vector under way through one block of cycles."""

    begun: bool
    vector_b: Vec3  # as the gyro has turned it, less `bias_b`
    bias_b: Vec3  # [rad/s] the gyro's by what was known when the block began: d stays small and so linear
    by_bias: Mat3  # F
    by_scale: Mat3  # G
    time: float  # [s] since the block began
    turn: float  # [rad] that the body has turned since


NO_LINE = Line(False, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), NO_MATRIX, NO_MATRIX, 0.0, 0.0)
"""No block has begun."""


@kernel
def times_diagonal(m: Mat3, d: Vec3) -> Mat3:
    """M diag(d)."""
    return (
        (m[0][0] * d[0], m[0][1] * d[1], m[0][2] * d[2]),
        (m[1][0] * d[0], m[1][1] * d[1], m[1][2] * d[2]),
        (m[2][0] * d[0], m[2][1] * d[1], m[2][2] * d[2]),
    )


@kernel
def begin_line(vector_b: Vec3, bias_b: Vec3) -> Line:
    """A block that begins with a vector whose measurement owes nothing to the gyro."""
    return Line(True, vector_b, bias_b, NO_MATRIX, NO_MATRIX, 0.0, 0.0)


@kernel
def carry(line: Line, gyro_b: Vec3, dt: float) -> Line:
    """The block after `dt` [s] at the rate [rad/s] that the gyro reads."""
    if not line.begun:
        return line
    rate_b = subtract(gyro_b, line.bias_b)
    turn = rotation_vector_to_dcm(scale(dt, rate_b))
    after_b = multiply(turn, line.vector_b)
    # the mean of begin and end of the step, so that long steps at high rates are right too
    push = scaled(-0.5 * dt, matmul(skew(after_b), sum_of(turn, IDENTITY)))
    return Line(
        True,
        after_b,
        line.bias_b,
        sum_of(matmul(turn, line.by_bias), push),
        sum_of(matmul(turn, line.by_scale), times_diagonal(push, gyro_b)),
        line.time + dt,
        line.turn + dt * norm(rate_b),
    )


@kernel
def off_the_gyro(line: Line, behind_b: Vec3) -> Vec3:
    """What a measured vector would be off one that the gyro had carried as it reads.

    Args:
        behind_b: what it is off the line.
    """
    return add(behind_b, multiply(line.by_bias, line.bias_b))
