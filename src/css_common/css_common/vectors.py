# SPDX-License-Identifier: Apache-2.0
"""Vectors as tuples of three floats, matrices as tuples of three rows: no allocation in compiled code."""

import math
from typing import TypeAlias

import numpy as np

from css_common.kernel import kernel

Vec3: TypeAlias = tuple[float, float, float]
Mat3: TypeAlias = tuple[Vec3, Vec3, Vec3]


@kernel
def dot(a: Vec3, b: Vec3) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a: Vec3, b: Vec3) -> Vec3:
    """Vector product a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@kernel
def add(a: Vec3, b: Vec3) -> Vec3:
    """Sum a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@kernel
def subtract(a: Vec3, b: Vec3) -> Vec3:
    """Difference a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@kernel
def scale(k: float, a: Vec3) -> Vec3:
    """Product of a scalar and a vector."""
    return (k * a[0], k * a[1], k * a[2])


@kernel
def norm(a: Vec3) -> float:
    """Euclidean length."""
    return math.sqrt(dot(a, a))


@kernel
def unit(a: Vec3) -> Vec3:
    """Vector of length one along `a`; the zero vector stays zero."""
    length = norm(a)
    if length == 0.0:
        return (0.0, 0.0, 0.0)
    return scale(1.0 / length, a)


@kernel
def angle_between(a: Vec3, b: Vec3) -> float:
    """Angle between two vectors [rad], accurate near 0 and pi alike (unlike the arc cosine)."""
    return math.atan2(norm(cross(a, b)), dot(a, b))


@kernel
def axes_across(direction: Vec3) -> tuple[Vec3, Vec3]:
    """Two unit vectors that make a right-handed orthogonal triad with a unit vector: (e1, e2, direction)."""
    x, y, z = abs(direction[0]), abs(direction[1]), abs(direction[2])
    # the coordinate axis farthest from the direction gives a safe cross product
    if x <= y and x <= z:
        farthest = (1.0, 0.0, 0.0)
    elif y <= z:
        farthest = (0.0, 1.0, 0.0)
    else:
        farthest = (0.0, 0.0, 1.0)
    e1 = unit(cross(farthest, direction))
    return e1, cross(direction, e1)


@kernel
def row(a, i: int) -> Vec3:
    """Row `i` of an (N, 3) array as a vector."""
    return (a[i, 0], a[i, 1], a[i, 2])


@kernel
def multiply(m: Mat3, a: Vec3) -> Vec3:
    """Product of a matrix and a column vector."""
    return (dot(m[0], a), dot(m[1], a), dot(m[2], a))


@kernel
def multiply_transposed(m: Mat3, a: Vec3) -> Vec3:
    """Product of the transposed matrix and a column vector."""
    return (
        m[0][0] * a[0] + m[1][0] * a[1] + m[2][0] * a[2],
        m[0][1] * a[0] + m[1][1] * a[1] + m[2][1] * a[2],
        m[0][2] * a[0] + m[1][2] * a[1] + m[2][2] * a[2],
    )


@kernel
def transpose(m: Mat3) -> Mat3:
    """Transposed matrix."""
    return (
        (m[0][0], m[1][0], m[2][0]),
        (m[0][1], m[1][1], m[2][1]),
        (m[0][2], m[1][2], m[2][2]),
    )


@kernel
def matmul(a: Mat3, b: Mat3) -> Mat3:
    """Matrix product a b."""
    bt = transpose(b)
    return (
        (dot(a[0], bt[0]), dot(a[0], bt[1]), dot(a[0], bt[2])),
        (dot(a[1], bt[0]), dot(a[1], bt[1]), dot(a[1], bt[2])),
        (dot(a[2], bt[0]), dot(a[2], bt[1]), dot(a[2], bt[2])),
    )


def vector_of(values: np.ndarray) -> Vec3:
    """Three numbers of a message as a vector; plain Python, because the way into a kernel costs more."""
    x, y, z = values.tolist()
    return (x, y, z)


@kernel
def mat3(m) -> Mat3:
    """A (3, 3) array as a tuple of rows."""
    return (row(m, 0), row(m, 1), row(m, 2))
