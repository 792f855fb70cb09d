# SPDX-License-Identifier: Apache-2.0
"""Continuous momentum dumping with magnetic torque rods (Hogan & Schaub 2015).

Each wheel is asked for a despin torque u* = -c Js (Omega - Omega_ref). The rods answer its reaction on the
body as far as the field allows, with the dipoles mu = -([B x] Gt)^+ Gs u*, saturated before anything is
derived from them; their torque is tau = -[B x] Gt mu. The wheels take up what the rods cannot, du = Gs^+
(tau - Gs u*). The torque on the body is then -Gs (u* + du) + tau = 0, as long as the wheels in service span
all directions: dumping does not disturb the pointing.

All of it is linear. When wheels near their torque limit have no room for u* + du, wheels and rods are
reduced by one factor, which keeps the sum at zero.
"""

import math
from typing import NamedTuple

import numpy as np

from css_common.declared import builder, computed, given, made, table_of
from css_common.kernel import kernel
from css_common.schema import Values, choice, flag, real
from css_common.vectors import Vec3, add, axes_across, cross, dot, norm, row, scale, subtract, unit
from sunpoint_control.wheel_allocation import AllocationParameters, least_torque, spin_axis

ENABLED = flag("dumping.enabled", False, "dump wheel momentum with the torque rods", tunable=True)

_RPM = math.pi / 30.0
# Determinant relative to the squared trace below which the rods act along one direction only.
_RANK_ONE = 1e-10
_NO_FIELD = 1e-9  # [T]


def _wheel_inertia(values: Values) -> float:
    return float(values.wheels.inertia)


def _rod_axes(values: Values) -> np.ndarray:
    return np.ascontiguousarray(values.rods.axes, dtype=np.float64)


def _max_dipole(values: Values) -> float:
    return float(values.rods.max_dipole)


class DumpingParameters(NamedTuple):
    """How momentum is dumped, with the mission's `wheels` and `rods`."""

    enabled: bool = given(ENABLED)
    in_eclipse_only: bool = made(
        lambda word: word == "eclipse",
        choice("dumping.when", "always", ("always", "eclipse"), "at all times, or in the shadow alone", tunable=True),
    )
    gain: float = given(real("dumping.gain", 0.005, "1/s", "despin gain c", low=0.0, high=10.0, tunable=True))
    reference_speed: float = made(  # [rad/s]
        lambda rpm: rpm * _RPM,
        real("dumping.reference_speed_rpm", 0.0, "rpm", "wheel speed to dump to", low=-1e5, high=1e5, tunable=True),
    )
    wheel_inertia: float = computed(_wheel_inertia)  # [kg m^2]
    rod_axes_b: np.ndarray = computed(_rod_axes)  # (m, 3)
    max_dipole: float = computed(_max_dipole)  # [A m^2]


PARAMETERS = table_of(DumpingParameters)
parameters = builder(DumpingParameters)


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
def add_dumping(
    p: DumpingParameters, allocation: AllocationParameters, speeds, field_b: Vec3, torques, dipoles
) -> tuple[int, bool]:
    """Adds the dumping torques to motor torques (n,) [N m] within limits, and sets the dipoles (m,).

    Args:
        speeds: (n,) wheel speeds [rad/s].
        field_b: magnetic field [T].

    Returns:
        mask of the rods that were asked for more than they may give, and whether anything is dumped.
    """
    dipoles[:] = 0.0
    n = torques.shape[0]
    if norm(field_b) < _NO_FIELD:
        return 0, False
    wanted = (0.0, 0.0, 0.0)
    for i in range(n):
        wheel = allocation.wheels[i]
        wanted = add(wanted, scale(_despin_torque(p, wheel, speeds[i]), spin_axis(wheel)))
    rod_dipoles(p.rod_axes_b, wanted, field_b, dipoles)
    mask = _limit_dipoles(p.max_dipole, dipoles)
    rest = subtract(rod_torque(p.rod_axes_b, dipoles, field_b), wanted)

    share = 1.0
    limit = allocation.max_torque
    for i in range(n):
        u = _despin_torque(p, allocation.wheels[i], speeds[i]) + least_torque(allocation.wheels[i], rest)
        room = max(limit - (torques[i] if u > 0.0 else -torques[i]), 0.0)
        if abs(u) > room:
            share = min(share, room / abs(u))
    for i in range(n):
        u = _despin_torque(p, allocation.wheels[i], speeds[i]) + least_torque(allocation.wheels[i], rest)
        torques[i] += share * u
    for j in range(dipoles.shape[0]):
        dipoles[j] *= share
    return mask, share > 0.0


@kernel
def _despin_torque(p: DumpingParameters, wheel, speed: float) -> float:
    if wheel.mx == 0.0 and wheel.my == 0.0 and wheel.mz == 0.0:
        return 0.0  # out of service
    return -p.gain * p.wheel_inertia * (speed - p.reference_speed)


@kernel
def _limit_dipoles(limit: float, dipoles) -> int:
    """Scales dipoles together, in place, until none is above the limit: the torque keeps its direction."""
    mask = 0
    largest = 0.0
    for j in range(dipoles.shape[0]):
        size = abs(dipoles[j])
        largest = max(largest, size)
        if size > limit:
            mask |= 1 << j
    if mask != 0:
        for j in range(dipoles.shape[0]):
            dipoles[j] *= limit / largest
    return mask
