# SPDX-License-Identifier: Apache-2.0
"""How the wheels that are in use share a torque, in flight."""

from css_common.kernel import kernel
from css_common.vectors import Vec3, dot, multiply
from sunpoint_control.pseudo_inverse import NO_AXES, pseudo_inverse_of, with_axis
from sunpoint_control.wheel_allocation import spin_axis

_ACROSS = 0.05  # cosine


@kernel
def reallocate(wheels, out_of_use: int, tracks, out) -> int:
    """Writes the wheels (n,) of `WHEEL` as they are used; number of directions that their axes span.

    Args:
        wheels: as the parameters have them; one with a row of zeros is out of service.
        out_of_use: mask of those that are commanded nothing.
        tracks: (n,) of `wheel_tracks.TRACK`, with what each gives for what it is commanded.
    """
    m = NO_AXES
    for i in range(wheels.shape[0]):
        if _in_use(wheels[i], out_of_use, i):
            m = with_axis(m, spin_axis(wheels[i]))
    inverse, rank = pseudo_inverse_of(m)
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
