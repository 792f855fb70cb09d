# SPDX-License-Identifier: Apache-2.0
"""3 x 3 matrices as tuples of rows, beyond what `vectors` has."""

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, add, cross, dot, scale, transpose

IDENTITY: Mat3 = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@kernel
def skew(a: Vec3) -> Mat3:
    """[a x], so that [a x] b is the cross product of a and b."""
    return (0.0, -a[2], a[1]), (a[2], 0.0, -a[0]), (-a[1], a[0], 0.0)


@kernel
def scaled(k: float, m: Mat3) -> Mat3:
    """k M."""
    return scale(k, m[0]), scale(k, m[1]), scale(k, m[2])


@kernel
def sum_of(a: Mat3, b: Mat3) -> Mat3:
    """A + B."""
    return add(a[0], b[0]), add(a[1], b[1]), add(a[2], b[2])


@kernel
def inverse(m: Mat3) -> Mat3:
    """M^-1 of a regular matrix, in closed form: a library's has other last bits on another processor."""
    a, b, c = cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])
    return transpose(scaled(1.0 / dot(m[0], a), (a, b, c)))
