# SPDX-License-Identifier: Apache-2.0
"""Continuous momentum dumping with magnetic torque rods (Hogan & Schaub 2015).

Each wheel is asked for a despin torque u* = -c Js (Omega - Omega_ref). The rods answer its reaction on the
body as far as the field allows, with the dipoles mu = -([B x] Gt)^+ Gs u*, saturated before anything is
derived from them; their torque is tau = -[B x] Gt mu. The wheels take up what the rods cannot, du = Gs^+
(tau - Gs u*). The torque on the body is then -Gs (u* + du) + tau = 0, as long as the wheels in service span
all directions: dumping does not disturb the pointing.

Omega_ref is a speed common to all wheels, and on top of it that which makes up a momentum h_ref that the wheels
shall keep together, of least norm: Gs^+ h_ref / Js.

All of it is linear. When wheels near their torque limit have no room for u* + du, wheels and rods are
reduced by one factor, which keeps the sum at zero.
"""

import math
from typing import NamedTuple

from css_common.declared import builder, given, made, part, table_of
from css_common.kernel import kernel
from css_common.schema import choice, flag, real, reals
from css_common.vectors import Vec3, add, norm, scale, subtract, vector_of
from sunpoint_control.torque_rods import NO_FIELD, TorqueRods, limit_dipoles, rod_dipoles, rod_torque
from sunpoint_control.wheel_allocation import AllocationParameters, least_torque, spin_axis

ENABLED = flag("dumping.enabled", False, "dump wheel momentum with the torque rods", tunable=True)

_RPM = math.pi / 30.0


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
    momentum_b: Vec3 = made(  # [N m s]
        vector_of,
        reals(
            "dumping.momentum",
            (0.0, 0.0, 0.0),
            "N m s",
            "momentum of all wheels in b to dump to, on top of dumping.reference_speed_rpm",
            length=3,
            tunable=True,
        ),
    )
    rods: TorqueRods = part(TorqueRods)


PARAMETERS = table_of(DumpingParameters)
parameters = builder(DumpingParameters)


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
    if norm(field_b) < NO_FIELD:
        return 0, False
    wanted = (0.0, 0.0, 0.0)
    for i in range(n):
        wheel = allocation.wheels[i]
        wanted = add(wanted, scale(_despin_torque(p, wheel, speeds[i]), spin_axis(wheel)))
    rod_dipoles(p.rods.axes_b, wanted, field_b, dipoles)
    mask = limit_dipoles(p.rods.max_dipoles, dipoles)
    rest = subtract(rod_torque(p.rods.axes_b, dipoles, field_b), wanted)

    share = 1.0
    for i in range(n):
        u = _despin_torque(p, allocation.wheels[i], speeds[i]) + least_torque(allocation.wheels[i], rest)
        room = max(allocation.wheels[i].max_torque - (torques[i] if u > 0.0 else -torques[i]), 0.0)
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
    reference = p.reference_speed + least_torque(wheel, p.momentum_b) / wheel.inertia
    return -p.gain * wheel.inertia * (speed - reference)
