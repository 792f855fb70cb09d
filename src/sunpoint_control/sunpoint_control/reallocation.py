# SPDX-License-Identifier: Apache-2.0
"""The pseudo-inverse over those wheels that are in use, in flight and in closed form.

With the sum M of g g^T over the wheels in use, wheel i has the row M^+ g_i. M is symmetric, 3 by 3: its pseudo-
inverse is its inverse; of rank two, with the unit vector n that no wheel has a part along and any k > 0, (M + k n
n^T)^-1 less n n^T / k; of rank one M over its squared trace. A torque along what is not spanned is then left out,
which is the nearest that the wheels can give.
"""

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, dot, multiply
from sunpoint_control.wheel_allocation import spin_axis

# Of the cubed trace of M, its determinant, and of the squared trace, the trace of its adjugate: below it axes span no
# volume, and no plane. Axes 0.1 deg beside a plane give 1e-7 of the first.
_VOLUME = 1e-6
_PLANE = 1e-6
_ACROSS = 0.05  # cosine


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


@kernel
def reallocate(wheels, out_of_use: int, tracks, out) -> int:
    """Writes the wheels (n,) of `WHEEL` as they are used; number of directions that their axes span.

    Args:
        wheels: as the parameters have them; one with a row of zeros is out of service.
        out_of_use: mask of those that are commanded nothing.
        tracks: (n,) of `wheel_tracks.TRACK`, with what each gives for what it is commanded.
    """
    xx = xy = xz = yy = yz = zz = 0.0
    for i in range(wheels.shape[0]):
        w = wheels[i]
        if _in_use(w, out_of_use, i):
            xx += w.gx * w.gx
            xy += w.gx * w.gy
            xz += w.gx * w.gz
            yy += w.gy * w.gy
            yz += w.gy * w.gz
            zz += w.gz * w.gz
    inverse, rank = pseudo_inverse_of(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))
    for i in range(wheels.shape[0]):
        w, used = wheels[i], out[i]
        used.gx, used.gy, used.gz = w.gx, w.gy, w.gz
        used.inertia, used.max_torque, used.max_speed = w.inertia, w.max_torque, w.max_speed
        used.mx = used.my = used.mz = 0.0
        if _in_use(w, out_of_use, i):
            x, y, z = multiply(inverse, spin_axis(w))
            c = tracks[i].gain
            used.mx, used.my, used.mz = x / c, y / c, z / c
    return rank


@kernel
def acts_across(wheels, axis_b: Vec3) -> bool:
    """Whether no wheel (n,) of `WHEEL` that is used turns the body about an axis."""
    for i in range(wheels.shape[0]):
        if _in_use(wheels[i], 0, i) and abs(dot(spin_axis(wheels[i]), axis_b)) > _ACROSS:
            return False
    return True


@kernel
def _in_use(wheel, out_of_use: int, i: int) -> bool:
    row: Vec3 = (wheel.mx, wheel.my, wheel.mz)
    return (out_of_use >> i) & 1 == 0 and (row[0] != 0.0 or row[1] != 0.0 or row[2] != 0.0)
