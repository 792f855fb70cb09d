# SPDX-License-Identifier: Apache-2.0
"""The sections `wheels` and `rods`: what turns the spacecraft, alike or each of its own."""

from collections.abc import Iterator

import numpy as np

from css_common.schema import Parameter, Table, Values, flag, real, reals
from css_common.section import Section, unit_rows

WHEELS_FITTED = flag(
    "wheels.fitted", True, "the spacecraft carries reaction wheels; without them it flies uncontrolled"
)
WHEEL_AXES = reals(
    "wheels.axes",
    (),
    "-",
    "spin axes of the reaction wheels in b, one row of x, y, z each",
    columns=3,
    example="wheels: {axes: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]}",
)
WHEEL_INERTIA = real(
    "wheels.inertia",
    None,
    "kg m^2",
    "spin inertia of each wheel",
    low=0.0,
    open_low=True,
    example="wheels: {inertia: 0.001}",
)
WHEEL_MAX_TORQUE = real(
    "wheels.max_torque", None, "N m", "torque limit of each wheel", low=0.0, example="wheels: {max_torque: 0.030}"
)
WHEEL_MAX_SPEED = real(
    "wheels.max_speed_rpm", None, "rpm", "speed limit of each wheel", low=0.0, example="wheels: {max_speed_rpm: 6000.0}"
)
WHEEL_INERTIAS = reals(
    "wheels.inertias", (), "kg m^2", "spin inertia of each wheel; empty: wheels.inertia for all", low=1e-12
)
WHEEL_MAX_TORQUES = reals(
    "wheels.max_torques", (), "N m", "torque limit of each wheel; empty: wheels.max_torque for all", low=0.0
)
WHEEL_MAX_SPEEDS = reals(
    "wheels.max_speeds_rpm",
    (),
    "rpm",
    "speed limit of each wheel (its largest momentum over its inertia); empty: wheels.max_speed_rpm for all",
    low=0.0,
)

WHEELS: Table = (
    WHEELS_FITTED,
    WHEEL_AXES,
    WHEEL_INERTIA,
    WHEEL_MAX_TORQUE,
    WHEEL_MAX_SPEED,
    WHEEL_INERTIAS,
    WHEEL_MAX_TORQUES,
    WHEEL_MAX_SPEEDS,
)
_EACH: dict[Parameter[float], Parameter[np.ndarray]] = {
    WHEEL_INERTIA: WHEEL_INERTIAS,
    WHEEL_MAX_TORQUE: WHEEL_MAX_TORQUES,
    WHEEL_MAX_SPEED: WHEEL_MAX_SPEEDS,
}

RODS_FITTED = flag("rods.fitted", False, "the spacecraft carries magnetic torque rods")
ROD_AXES = reals(
    "rods.axes", (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), "-", "rod axes in b, a row each", columns=3
)
ROD_MAX_DIPOLE = real("rods.max_dipole", 20.0, "A m^2", "dipole limit of each rod", low=0.0)
ROD_MAX_DIPOLES = reals(
    "rods.max_dipoles", (), "A m^2", "dipole limit of each rod; empty: rods.max_dipole for all", low=0.0
)

RODS: Table = (
    RODS_FITTED,
    ROD_AXES,
    ROD_MAX_DIPOLE,
    ROD_MAX_DIPOLES,
)


def needed_of_wheels(values: Values) -> tuple[str, ...]:
    """What a component cannot do without that turns the wheels, if there are any."""
    if not values[WHEELS_FITTED]:
        return ()
    return (WHEEL_AXES.name, *(of_all.name for of_all, each in _EACH.items() if not len(values[each])))


def needed_of_wheel_momentum(values: Values) -> tuple[str, ...]:
    """What a component cannot do without that counts the momentum of the wheels that there are."""
    return (WHEEL_INERTIA.name,) if len(wheel_axes(values)) and not len(values[WHEEL_INERTIAS]) else ()


def wheel_axes(values: Values) -> np.ndarray:
    """Spin axes (N, 3) of the reaction wheels that the spacecraft carries, in b; none without wheels."""
    return values[WHEEL_AXES] if values[WHEELS_FITTED] else np.zeros((0, 3))


def of_each_wheel(values: Values, of_all: Parameter[float]) -> np.ndarray:
    """Inertia [kg m^2], largest torque [N m] or speed [rpm] of each wheel (N,); NaN where nobody has said.

    Args:
        of_all: WHEEL_INERTIA, WHEEL_MAX_TORQUE or WHEEL_MAX_SPEED.
    """
    each = values[_EACH[of_all]]
    return np.array(each) if len(each) else np.full(len(values[WHEEL_AXES]), values[of_all])


def rod_max_dipoles(values: Values) -> np.ndarray:
    """Largest dipole (M,) of each rod [A m^2]."""
    each = values[ROD_MAX_DIPOLES]
    return np.array(each) if len(each) else np.full(len(values[ROD_AXES]), values[ROD_MAX_DIPOLE])


def _wheels_conflicts(wheels: Values) -> Iterator[str]:
    if not len(wheels.axes):
        return
    yield from unit_rows("wheels.axes", wheels.axes, 3, 32)
    for key in ("inertias", "max_torques", "max_speeds_rpm"):
        if len(getattr(wheels, key)) not in (0, len(wheels.axes)):
            yield f"wheels.{key}: {len(getattr(wheels, key))} given, expected one for each of {len(wheels.axes)} wheels"
    rank = np.linalg.matrix_rank(wheels.axes) if wheels.axes.size else 0
    if rank < 3:
        yield f"wheels.axes: they span {rank} of 3 directions, expected axes that span all"


def _rods_conflicts(rods: Values) -> Iterator[str]:
    yield from unit_rows("rods.axes", rods.axes, 1, 32)
    if len(rods.max_dipoles) not in (0, len(rods.axes)):
        yield f"rods.max_dipoles: {len(rods.max_dipoles)} given, expected one for each of {len(rods.axes)} rods"


SECTIONS = {"wheels": Section(WHEELS, _wheels_conflicts), "rods": Section(RODS, _rods_conflicts)}
