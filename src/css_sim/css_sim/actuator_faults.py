# SPDX-License-Identifier: Apache-2.0
"""What faults make of wheels and rods: commands that are not followed, and wheels that are not as they were built."""

from typing import NamedTuple

import numpy as np

from css_common.fault_lines import FAULTS, Units
from css_common.kernel import kernel
from css_common.random_streams import RandomKey
from css_common.schema import Values
from css_common.sections import PERIOD, ROD_AXES, RODS_FITTED, WHEELS_FITTED, wheel_axes
from css_sim import faults
from css_sim.fault_effects import DEAD, FRICTION, ROD, SLOW, WHEEL, acts, spoil
from css_sim.fault_kinds import kinds_of
from css_sim.faults import CaseFault
from css_sim.rigid_body import WHEEL as WHEEL_FORM

KINDS = kinds_of("wheel", "rod", "tachometer")


class ActuatorFaults(NamedTuple):
    """Faults of one case, with room for what they make of its actuators."""

    faults: np.ndarray  # (F,) of fault_effects.FAULT; of tachometers too
    wheels: np.ndarray  # (N,) of rigid_body.WHEEL, written
    torque: np.ndarray  # (N,) [N m] written
    dipole: np.ndarray  # (M,) [A m^2] written


def units(values: Values) -> Units:
    """The wheels with their tachometers, and the rods, that may fail."""
    found = {}
    if values[WHEELS_FITTED]:
        found["wheel"] = found["tachometer"] = [str(i) for i in range(len(wheel_axes(values)))]
    if values[RODS_FITTED]:
        found["rod"] = [str(i) for i in range(len(values[ROD_AXES]))]
    return found


def case_faults(values: Values, key: RandomKey) -> list[CaseFault]:
    """Faults of one case."""
    return faults.case_faults(values[FAULTS], KINDS, units(values), key, values[PERIOD])


def with_room(table: np.ndarray, wheels: int, rods: int) -> ActuatorFaults:
    """Faults (F,) of FAULT of a spacecraft with so many wheels and rods."""
    return ActuatorFaults(table, np.zeros(wheels, WHEEL_FORM), np.zeros(wheels), np.zeros(rods))


@kernel
def spoil_actuators(p: ActuatorFaults, key: RandomKey, step: int, wheels, wheel_command, rod_command) -> None:
    """Writes the wheels and the commands of a control cycle as faults make them into the room for them."""
    for i in range(wheels.shape[0]):
        _copy(wheels[i], p.wheels[i])
        p.torque[i] = wheel_command[i]
    for i in range(rod_command.shape[0]):
        p.dipole[i] = rod_command[i]
    spoil(p.faults, WHEEL, key, step, p.torque)
    spoil(p.faults, ROD, key, step, p.dipole)
    for k in range(p.faults.shape[0]):
        fault = p.faults[k]
        if fault.sort != WHEEL or not acts(fault, step):
            continue
        wheel = p.wheels[fault.unit]
        if fault.kind == DEAD:
            wheel.max_torque = 0.0
        elif fault.kind == SLOW:
            wheel.max_speed = min(wheel.max_speed, fault.value)
        elif fault.kind == FRICTION:
            wheel.coulomb += fault.value
            wheel.viscous += fault.second


@kernel
def _copy(wheel, out) -> None:
    out.gx, out.gy, out.gz = wheel.gx, wheel.gy, wheel.gz
    out.inertia, out.response = wheel.inertia, wheel.response
    out.max_torque, out.max_speed = wheel.max_torque, wheel.max_speed
    out.coulomb, out.viscous = wheel.coulomb, wheel.viscous
