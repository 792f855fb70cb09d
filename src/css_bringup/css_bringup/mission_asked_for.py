# SPDX-License-Identifier: Apache-2.0
"""The mission that options of a command line describe."""

import argparse

from css_analysis.quantities import QUANTITIES
from css_bringup.options import complain, errors
from css_common.drawn_mission import drawn
from css_common.mission import SHARED, Mission, load_mission
from css_common.mission_file import MissionError
from css_common.schema import unknown_name


def mission_of(arguments: argparse.Namespace) -> Mission:
    """The mission that the options describe.

    Raises:
        MissionError: it is wrong.
    """
    overrides = list(arguments.overrides)
    for key in ("case", "seed", "duration"):
        value = getattr(arguments, key)
        if value is not None:
            overrides.append(f"mission.{key}={value}")
    mission = load_mission(arguments.mission, overrides)
    for quantity in mission.criteria:
        # measured by studies, which the packages that read missions know nothing of
        if quantity not in QUANTITIES:
            raise MissionError(f"{mission.origin}: {SHARED}: criteria.{unknown_name(quantity, QUANTITIES)}")
    for remark in mission.remarks:
        complain("warning:", remark)
    flies = drawn(mission)
    for line in flies.lines():
        errors.print(f"drawn for case {mission.values.mission.case}: {line}", soft_wrap=True)
    return flies.mission
