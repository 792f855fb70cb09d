# SPDX-License-Identifier: Apache-2.0
"""The 3U cubesat in safe mode, for tests of what it flies with."""

from functools import cache

from css_common.mission import load_mission
from css_common.schema import Values

MISSION = "cubesat_3u_safe"


@cache
def control_values(*overrides: str) -> Values:
    """Values of its control with torque rods, after `key=value` on the node's own keys or on those of sections."""
    own = [o if o.split(".")[0].split("=")[0] in _SECTIONS else f"magnetic_control.{o}" for o in overrides]
    return load_mission(MISSION, own).node("magnetic_control").values


_SECTIONS = ("mission", "orbit", "spacecraft", "rods", "magnetometer", "wheels", "graph")
