# SPDX-License-Identifier: Apache-2.0
"""The pseudo-inverse over axes in closed form: the same bits on every processor, which a library's are not.

With the sum M of g g^T over the axes, axis i has the row M^+ g_i. M is symmetric, 3 by 3: its pseudo-inverse is its
inverse; of rank two, with the unit vector n that no axis has a part along and any k > 0, (M + k n n^T)^-1 less
n n^T / k; of rank one M over its squared trace. What is wanted along a direction that is not spanned is then left out,
which is the nearest that the axes can give.
"""

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, dot

# Of the cubed trace of M, its determinant, and of the squared trace, the trace of its adjugate: below it axes span no
# volume, and no plane. Axes 0.1 deg beside a plane give 1e-7 of the first.
_VOLUME = 1e-6
_PLANE = 1e-6

NO_AXES: Mat3 = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
"""M of no axis."""


@kernel
def with_axis(m: Mat3, g: Vec3) -> Mat3:
    """M + g g^T."""
    x, y, z = g
    xy, xz, yz = m[0][1] + x * y, m[0][2] + x * z, m[1][2] + y * z
    return (m[0][0] + x * x, xy, xz), (xy, m[1][1] + y * y, yz), (xz, yz, m[2][2] + z * z)


@kernel
def _adjugate(m: Mat3) -> Mat3:
    """Of a symmetric matrix."""
    a = m[1][1] * m[2][2] - m[1][2] * m[1][2]
    b = m[0][2] * m[1][2] - m[0][1] * m[2][2]
    c = m[0][1] * m[1][2] - m[0][2] * m[1][1]
    d = m[0][0] * m[2][2] - m[0][2] * m[0][2]
    e = m[0][1] * m[0][2] - m[0][0] * m[1][2]
    f = m[0][0] * m[1][1] - m[0][1] * m[0][1]
    return ((a, b, c), (b, d, e), (c, e, f))


@kernel
def _trace(m: Mat3) -> float:
    return m[0][0] + m[1][1] + m[2][2]


@kernel
def _plus(k: float, a: Mat3, q: float, b: Mat3) -> Mat3:
    return (
        (k * a[0][0] + q * b[0][0], k * a[0][1] + q * b[0][1], k * a[0][2] + q * b[0][2]),
        (k * a[1][0] + q * b[1][0], k * a[1][1] + q * b[1][1], k * a[1][2] + q * b[1][2]),
        (k * a[2][0] + q * b[2][0], k * a[2][1] + q * b[2][1], k * a[2][2] + q * b[2][2]),
    )


@kernel
def pseudo_inverse_of(m: Mat3) -> tuple[Mat3, int]:
    """Pseudo-inverse of a symmetric matrix without negative eigenvalues, and its rank."""
    adjugate = _adjugate(m)
    determinant = dot(m[0], adjugate[0])
    trace, minors = _trace(m), _trace(adjugate)
    if determinant > _VOLUME * trace * trace * trace:
        return _plus(1.0 / determinant, adjugate, 0.0, adjugate), 3
    if minors > _PLANE * trace * trace:
        # the adjugate of rank two is n n^T times the product of the eigenvalues
        filled = _plus(1.0, m, trace / minors, adjugate)
        inverse = _adjugate(filled)
        return _plus(1.0 / dot(filled[0], inverse[0]), inverse, -1.0 / (trace * minors), adjugate), 2
    if trace > 0.0:
        return _plus(1.0 / (trace * trace), m, 0.0, m), 1
    return m, 0
