# SPDX-License-Identifier: Apache-2.0
"""Magnetic torque rods: dipoles for a wanted torque, their limit, and the torque that they give.

A rod along g with the dipole m gives the torque m g x B, normal to the field: no set of rods turns the body about the
field line.
"""

from typing import NamedTuple

import numpy as np

from css_common.actuator_sections import rod_max_dipoles
from css_common.declared import computed
from css_common.kernel import kernel
from css_common.schema import Values
from css_common.vectors import Vec3, axes_across, cross, dot, row, unit

NO_FIELD = 1e-9
"""Field [T] below which rods do nothing."""

# Determinant relative to the squared trace below which the rods act along one direction only.
_RANK_ONE = 1e-10


def _axes(values: Values) -> np.ndarray:
    return np.ascontiguousarray(values.rods.axes, dtype=np.float64)


class TorqueRods(NamedTuple):
    """The mission's `rods`."""

    axes_b: np.ndarray = computed(_axes)  # (m, 3)
    max_dipoles: np.ndarray = computed(rod_max_dipoles)  # (m,) [A m^2]


@kernel
def rod_dipoles(rod_axes_b, torque_b: Vec3, field_b: Vec3, out) -> None:
    """Writes the least dipoles (m,) [A m^2] whose torque comes nearest to `torque_b` [N m] in `field_b` [T].

    A rod gives a torque normal to the field, a_j = g_j x B. In an orthonormal basis of that plane the
    pseudo-inverse of the m columns a_j needs the inverse of a 2 x 2 matrix only.
    """
    b = unit(field_b)
    e1, e2 = axes_across(b)
    m11 = m12 = m22 = 0.0
    for j in range(rod_axes_b.shape[0]):
        a = cross(row(rod_axes_b, j), field_b)
        a1, a2 = dot(a, e1), dot(a, e2)
        m11 += a1 * a1
        m12 += a1 * a2
        m22 += a2 * a2
    t1, t2 = dot(torque_b, e1), dot(torque_b, e2)
    trace = m11 + m22
    determinant = m11 * m22 - m12 * m12
    if trace <= 0.0:
        w1 = w2 = 0.0
    elif determinant > _RANK_ONE * trace * trace:
        w1 = (m22 * t1 - m12 * t2) / determinant
        w2 = (m11 * t2 - m12 * t1) / determinant
    else:
        # the pseudo-inverse of a symmetric matrix of rank one is the matrix over its squared trace
        w1 = (m11 * t1 + m12 * t2) / (trace * trace)
        w2 = (m12 * t1 + m22 * t2) / (trace * trace)
    for j in range(rod_axes_b.shape[0]):
        a = cross(row(rod_axes_b, j), field_b)
        out[j] = dot(a, e1) * w1 + dot(a, e2) * w2


@kernel
def rod_torque(rod_axes_b, dipoles, field_b: Vec3) -> Vec3:
    """Torque of the rods on the body [N m]: m x B."""
    x = y = z = 0.0
    for j in range(rod_axes_b.shape[0]):
        x += dipoles[j] * rod_axes_b[j, 0]
        y += dipoles[j] * rod_axes_b[j, 1]
        z += dipoles[j] * rod_axes_b[j, 2]
    return cross((x, y, z), field_b)


@kernel
def limit_dipoles(limits, dipoles) -> int:
    """Scales dipoles together, in place, until none is above its limit (m,): the torque keeps its direction."""
    mask = 0
    k = 1.0
    for j in range(dipoles.shape[0]):
        size = abs(dipoles[j])
        if size > limits[j]:
            mask |= 1 << j
            k = min(k, limits[j] / size)
    if mask != 0:
        for j in range(dipoles.shape[0]):
            dipoles[j] *= k
    return mask
