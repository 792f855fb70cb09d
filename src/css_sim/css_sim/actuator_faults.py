# SPDX-License-Identifier: Apache-2.0
"""What faults make of wheels and rods: commands that are not followed, and wheels that are not as they were built."""

from typing import NamedTuple

import numpy as np

from css_common.actuator_sections import ROD_AXES, RODS_FITTED, WHEELS_FITTED, wheel_axes
from css_common.case_faults import CaseFault, CaseFaults
from css_common.fault_lines import FAULTS, Units
from css_common.kernel import kernel
from css_common.mission_section import PERIOD
from css_common.random_streams import RandomKey
from css_common.schema import Values
from css_sim import faults
from css_sim.fault_effects import DEAD, FRICTION, ROD, SLOW, WHEEL, acts, spoil
from css_sim.fault_kinds import kinds_of

KINDS = kinds_of("wheel", "rod", "tachometer")


class Felt(NamedTuple):
    """Room for what faults make of the actuators of one case: what its spacecraft then is and is commanded."""

    wheels: np.ndarray  # (N,) of rigid_body.WHEEL
    torque: np.ndarray  # (N,) [N m]
    dipole: np.ndarray  # (M,) [A m^2]


def new_felt(wheels: np.ndarray, rods: int) -> Felt:
    """Room for a spacecraft with so many rods and these wheels (N,) of rigid_body.WHEEL."""
    return Felt(wheels.copy(), np.zeros(len(wheels)), np.zeros(rods))


def units(values: Values) -> Units:
    """The wheels with their tachometers, and the rods, that may fail."""
    found = {}
    if values[WHEELS_FITTED]:
        found["wheel"] = found["tachometer"] = [str(i) for i in range(len(wheel_axes(values)))]
    if values[RODS_FITTED]:
        found["rod"] = [str(i) for i in range(len(values[ROD_AXES]))]
    return found


def of_case(values: Values, key: RandomKey) -> CaseFaults:
    """The faults of one case, by the lines that there are."""
    return faults.of_case(KINDS, units(values), key, values[PERIOD])


def case_faults(values: Values, key: RandomKey) -> list[CaseFault]:
    """Faults of one case."""
    return of_case(values, key).of(values[FAULTS])


@kernel
def spoil_actuators(faults, key: RandomKey, step: int, wheels, torque, dipole, felt: Felt) -> None:
    """Writes what faults (F,) of FAULT make of wheels and commands at a control cycle into the room for it.

    Args:
        wheels: (N,) of rigid_body.WHEEL, as they were built.
        torque: (N,) commanded [N m].
        dipole: (M,) commanded [A m^2].
    """
    for i in range(wheels.shape[0]):
        _copy(wheels[i], felt.wheels[i])
        felt.torque[i] = torque[i]
    for i in range(dipole.shape[0]):
        felt.dipole[i] = dipole[i]
    spoil(faults, WHEEL, key, step, felt.torque)
    spoil(faults, ROD, key, step, felt.dipole)
    for k in range(faults.shape[0]):
        fault = faults[k]
        if fault.sort != WHEEL or not acts(fault, step):
            continue
        wheel = felt.wheels[fault.unit]
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
