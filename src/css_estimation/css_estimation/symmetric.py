# SPDX-License-Identifier: Apache-2.0
"""Symmetric 3 x 3 matrices as the six numbers of their upper triangle: xx, xy, xz, yy, yz, zz.

What is stored once cannot become unsymmetric by rounding.
"""

import math

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, add, dot, scale, subtract

Symmetric = tuple[float, float, float, float, float, float]


@kernel
def isotropic(variance: float) -> Symmetric:
    """`variance` times the identity."""
    return (variance, 0.0, 0.0, variance, 0.0, variance)


@kernel
def trace(p: Symmetric) -> float:
    """Sum of the diagonal."""
    return p[0] + p[3] + p[5]


@kernel
def product(p: Symmetric, v: Vec3) -> Vec3:
    """P v."""
    return (
        p[0] * v[0] + p[1] * v[1] + p[2] * v[2],
        p[1] * v[0] + p[3] * v[1] + p[4] * v[2],
        p[2] * v[0] + p[4] * v[1] + p[5] * v[2],
    )


@kernel
def add_outer(p: Symmetric, k: float, v: Vec3) -> Symmetric:
    """P + k v v^T."""
    return (
        p[0] + k * v[0] * v[0],
        p[1] + k * v[0] * v[1],
        p[2] + k * v[0] * v[2],
        p[3] + k * v[1] * v[1],
        p[4] + k * v[1] * v[2],
        p[5] + k * v[2] * v[2],
    )


@kernel
def subtract_pair(p: Symmetric, u: Vec3, v: Vec3) -> Symmetric:
    """P - u v^T - v u^T."""
    return (
        p[0] - 2.0 * u[0] * v[0],
        p[1] - u[0] * v[1] - v[0] * u[1],
        p[2] - u[0] * v[2] - v[0] * u[2],
        p[3] - 2.0 * u[1] * v[1],
        p[4] - u[1] * v[2] - v[1] * u[2],
        p[5] - 2.0 * u[2] * v[2],
    )


@kernel
def scaled(p: Symmetric, k: float) -> Symmetric:
    """k P."""
    return (k * p[0], k * p[1], k * p[2], k * p[3], k * p[4], k * p[5])


@kernel
def at_most(p: Symmetric, largest: float) -> Symmetric:
    """P, shrunk as a whole so that nothing on the diagonal is above `largest`.

    Clipping the diagonal alone can leave no covariance at all.
    """
    diagonal = max(p[0], max(p[3], p[5]))
    return scaled(p, largest / diagonal) if diagonal > largest else p


@kernel
def congruence(m: Mat3, p: Symmetric) -> Symmetric:
    """M P M^T."""
    a = product(p, m[0])
    b = product(p, m[1])
    return (
        dot(m[0], a),
        dot(m[1], a),
        dot(m[2], a),
        dot(m[1], b),
        dot(m[2], b),
        dot(m[2], product(p, m[2])),
    )


@kernel
def inverse(p: Symmetric) -> Symmetric:
    """P^-1 of a positive definite P."""
    xx, xy, xz, yy, yz, zz = p
    a, b, c = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    k = 1.0 / (xx * a + xy * b + xz * c)
    return (k * a, k * b, k * c, k * (xx * zz - xz * xz), k * (xy * xz - xx * yz), k * (xx * yy - xy * xy))


@kernel
def row_major(p: Symmetric) -> tuple[float, float, float, float, float, float, float, float, float]:
    """All nine elements, row by row."""
    return (p[0], p[1], p[2], p[1], p[3], p[4], p[2], p[4], p[5])


@kernel
def of_row_major(p: tuple[float, float, float, float, float, float, float, float, float]) -> Symmetric:
    """Of all nine elements."""
    return (p[0], p[1], p[2], p[4], p[5], p[8])


@kernel
def _rotation(pp: float, qq: float, pq: float) -> tuple[float, float, float]:
    """Tangent, cosine and sine of the smaller rotation that makes the off-diagonal element pq zero."""
    if pq == 0.0:
        return 0.0, 1.0, 0.0
    theta = 0.5 * (qq - pp) / pq
    t = math.copysign(1.0, theta) / (abs(theta) + math.sqrt(1.0 + theta * theta))
    c = 1.0 / math.sqrt(1.0 + t * t)
    return t, c, t * c


@kernel
def _rotated(c: float, s: float, u: Vec3, v: Vec3) -> tuple[Vec3, Vec3]:
    return subtract(scale(c, u), scale(s, v)), add(scale(s, u), scale(c, v))


# Convergence is quadratic: four sweeps leave rounding in any 3 x 3 matrix, two more are a reserve.
_SWEEPS = 6


@kernel
def eigen(p: Symmetric) -> tuple[Vec3, Mat3]:
    """Eigenvalues, largest first, and their orthonormal eigenvectors as rows.

    Cyclic Jacobi rotations (Golub & Van Loan, Matrix Computations, section 8.5): accurate for equal and for tiny
    eigenvalues too.
    """
    xx, xy, xz, yy, yz, zz = p
    u, v, w = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    for _ in range(_SWEEPS):
        t, c, s = _rotation(xx, yy, xy)
        xx, yy, xy, xz, yz = xx - t * xy, yy + t * xy, 0.0, c * xz - s * yz, s * xz + c * yz
        u, v = _rotated(c, s, u, v)
        t, c, s = _rotation(xx, zz, xz)
        xx, zz, xz, xy, yz = xx - t * xz, zz + t * xz, 0.0, c * xy - s * yz, s * xy + c * yz
        u, w = _rotated(c, s, u, w)
        t, c, s = _rotation(yy, zz, yz)
        yy, zz, yz, xy, xz = yy - t * yz, zz + t * yz, 0.0, c * xy - s * xz, s * xy + c * xz
        v, w = _rotated(c, s, v, w)
        if xy == 0.0 and xz == 0.0:
            break
    if xx < yy:
        xx, yy, u, v = yy, xx, v, u
    if yy < zz:
        yy, zz, v, w = zz, yy, w, v
    if xx < yy:
        xx, yy, u, v = yy, xx, v, u
    return (xx, yy, zz), (u, v, w)


@kernel
def inverse_form(p: Symmetric, v: Vec3) -> float:
    """v^T P^-1 v of a positive definite P, by its Cholesky factor; infinite when P is not."""
    if not p[0] > 0.0:
        return math.inf
    l11 = math.sqrt(p[0])
    l21, l31 = p[1] / l11, p[2] / l11
    d22 = p[3] - l21 * l21
    if not d22 > 0.0:
        return math.inf
    l22 = math.sqrt(d22)
    l32 = (p[4] - l31 * l21) / l22
    d33 = p[5] - l31 * l31 - l32 * l32
    if not d33 > 0.0:
        return math.inf
    y1 = v[0] / l11
    y2 = (v[1] - l21 * y1) / l22
    y3 = v[2] - l31 * y1 - l32 * y2
    return y1 * y1 + y2 * y2 + y3 * y3 / d33
