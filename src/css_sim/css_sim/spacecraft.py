# SPDX-License-Identifier: Apache-2.0
"""The plant of the control loop: body with wheels, torque rods and disturbances, one control cycle at a time."""

from typing import NamedTuple

import numpy as np

from css_common.actuator_sections import ROD_AXES, RODS_FITTED, rod_max_dipoles
from css_common.attitude import mrp_to_dcm
from css_common.kernel import kernel
from css_common.random_streams import RandomKey
from css_common.schema import Values
from css_common.vectors import Vec3, add, cross, multiply
from css_environment.ephemeris import EnvironmentState
from css_sim import disturbances
from css_sim.disturbances import Disturbances, disturbance_torque
from css_sim.initial_conditions import dispersed_body, dispersed_dipole, has_dipole
from css_sim.rigid_body import RigidBody, RotationState, propagate


class Spacecraft(NamedTuple):
    """All that moves the body."""

    body: RigidBody
    disturbances: Disturbances
    rod_axes_b: np.ndarray  # (M, 3) unit axes of the torque rods; none without rods
    rod_max_dipoles: np.ndarray  # (M,) [A m^2]
    disturbed: bool  # some disturbance acts


def spacecraft(values: Values, key: RandomKey, substeps: int = 1) -> Spacecraft:
    """The spacecraft of one case, with its drawn mass properties and dipole (sections spacecraft, wheels and rods)."""
    torques = disturbances.parameters(values)
    axes = values[ROD_AXES] if values[RODS_FITTED] else np.zeros((0, 3))
    return Spacecraft(
        body=dispersed_body(values, key, substeps),
        disturbances=torques._replace(dipole_b=dispersed_dipole(values, key)),
        rod_axes_b=np.ascontiguousarray(axes, dtype=np.float64),
        rod_max_dipoles=rod_max_dipoles(values),
        disturbed=any((torques.gravity_gradient, torques.aerodynamic, torques.solar_pressure, *torques.torque_b))
        or has_dipole(values),
    )


@kernel
def rod_dipole(axes_b, max_dipoles, command) -> Vec3:
    """Dipole of all rods in b [A m^2]; commands (M,) beyond limits (M,) are cut, those that are no number are 0."""
    x, y, z = 0.0, 0.0, 0.0
    for i in range(command.shape[0]):
        m, max_dipole = command[i], max_dipoles[i]
        if not abs(m) <= max_dipole:
            m = max_dipole if m > max_dipole else (-max_dipole if m < -max_dipole else 0.0)
        x += m * axes_b[i, 0]
        y += m * axes_b[i, 1]
        z += m * axes_b[i, 2]
    return (x, y, z)


@kernel
def advance(
    p: Spacecraft,
    state: RotationState,
    wheel_momentum,
    wheel_command,
    rod_command,
    environment: EnvironmentState,
    dt: float,
    wheel_torque_out,
) -> tuple[RotationState, int, int]:
    """Advance by one control cycle under commands that are held over it.

    Torques of the environment are those at the start of the cycle.

    Args:
        wheel_momentum: (N,) [N m s], advanced in place.
        wheel_command: (N,) motor torques [N m].
        rod_command: (M,) dipoles [A m^2]; M is 0 without rods.
        environment: at the start of the cycle.
        dt: length of the cycle [s].
        wheel_torque_out: (N,) motor torques applied [N m], written.

    Returns:
        Rotation state, mask of torque-limited wheels, mask of speed-limited wheels.
    """
    torque_b = (0.0, 0.0, 0.0)
    if p.disturbed or p.rod_axes_b.shape[0] > 0:
        dcm_bn = mrp_to_dcm(state.sigma_bn)
        if p.disturbed:
            torque_b = disturbance_torque(p.disturbances, p.body.inertia, dcm_bn, environment)
        if p.rod_axes_b.shape[0] > 0:
            field_b = multiply(dcm_bn, environment.field_n)
            torque_b = add(torque_b, cross(rod_dipole(p.rod_axes_b, p.rod_max_dipoles, rod_command), field_b))
    return propagate(p.body, state, wheel_momentum, wheel_command, torque_b, dt, wheel_torque_out)
