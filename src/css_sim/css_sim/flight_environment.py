# SPDX-License-Identifier: Apache-2.0
"""The true environment along a mission's orbit."""

from css_common.schema import Table, Values, choice, flag
from css_environment.mission_environment import MissionEnvironment
from css_environment.orbit import Orbit

_SHADOW = choice("shadow", "conical", ("conical", "cylindrical"), "shape of the Earth's shadow")
GEOMAGNETIC_FIELD = flag("geomagnetic_field", True, "compute the field; without it the truth's field is zero")

PARAMETERS: Table = (_SHADOW, GEOMAGNETIC_FIELD)


def flight_environment(values: Values, field: bool = True, orbit: Orbit | None = None) -> MissionEnvironment:
    """The environment that `PARAMETERS` and the mission's orbit describe.

    Args:
        field: False when nobody needs the field.
        orbit: of the case, where cases differ in theirs.
    """
    field = field and values[GEOMAGNETIC_FIELD]
    return MissionEnvironment(values, field=field, conical_shadow=values[_SHADOW] == "conical", orbit=orbit)
