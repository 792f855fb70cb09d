# SPDX-License-Identifier: Apache-2.0
"""What the cases of a study with dispersed parameters fly, each a mission of its own."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import pyarrow as pa

from css_common.actuator_sections import RODS_FITTED
from css_common.dispersions import Dispersion
from css_common.drawn_mission import drawn, drawn_values
from css_common.mission import Mission, MissionError
from css_common.mission_section import MISSION
from css_common.orbit_section import ORBIT
from css_common.preflight import preflight
from css_common.schema import Table
from css_estimation.attitude import flight_references
from css_estimation.sun import flight_sky
from css_estimation.sun.eclipse_detector import SOURCE
from css_sim import earth_reflectivity, flight_environment, initial_conditions, orbit_dispersion
from css_sim.disturbances import DIPOLE

_PREFIX = "drawn."
_TABLES: tuple[Table, ...] = (
    MISSION,
    ORBIT,
    flight_environment.PARAMETERS,
    earth_reflectivity.PARAMETERS,
    orbit_dispersion.PARAMETERS,
    flight_sky.PARAMETERS,
    flight_references.PARAMETERS,
    (SOURCE, flight_sky.USE_FIELD, DIPOLE, RODS_FITTED),
)


def case_mission(mission: Mission, case: int) -> Mission:
    """The mission of a case, with what it draws.

    Raises:
        MissionError: the parameters that it draws cannot fly.
    """
    flies = mission.with_overrides([f"mission.case={case}"])
    if not mission.dispersions:
        return flies
    flies = drawn(flies).mission
    try:
        preflight(flies)
    except MissionError as error:
        raise MissionError(f"case {case} draws what cannot fly: {error}") from error
    return flies


def share_surroundings(dispersions: Iterable[Dispersion]) -> bool:
    """Whether cases that differ in these parameters have orbit, Sun, field and light of the Earth in common."""
    surrounding = {parameter.name for table in _TABLES for parameter in table}
    surrounding |= {p.name for p in initial_conditions.PARAMETERS if "dipole" in p.name}
    return not any(_own_name(one) in surrounding for one in dispersions)


def drawn_names(mission: Mission) -> tuple[str, ...]:
    """Columns that a study of a mission has for its dispersed parameters."""
    return tuple(dict.fromkeys(f"{_PREFIX}{one.key}" for one in mission.dispersions))


def drawn_columns(mission: Mission, numbers: np.ndarray) -> dict[str, pa.Array]:
    """What cases (C,) draw, by the name of the column: numbers, lists of numbers, or words."""
    values = [drawn_values(mission, int(number))[0] for number in numbers] if mission.dispersions else []
    return {name: pa.array([_plain(of[name.removeprefix(_PREFIX)]) for of in values]) for name in drawn_names(mission)}


def _plain(value: Any) -> Any:
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value


def _own_name(one: Dispersion) -> str:
    """Name of the parameter in the table of its node."""
    return one.key if one.node is None else one.key.removeprefix(f"{one.node}.")
