# SPDX-License-Identifier: Apache-2.0
"""The mission that options of a command line describe."""

import argparse

from css_analysis.study_criteria import refuse_unknown_criteria
from css_bringup.options import complain, errors
from css_common.drawn_mission import drawn
from css_common.mission import Mission, load_mission


def overrides_of(arguments: argparse.Namespace) -> list[str]:
    """What the options change in the mission, as KEY=VALUE."""
    overrides = list(arguments.overrides)
    for key in ("case", "seed", "duration"):
        value = getattr(arguments, key)
        if value is not None:
            overrides.append(f"mission.{key}={value}")
    return overrides


def mission_of(arguments: argparse.Namespace) -> Mission:
    """The mission that the options describe.

    Raises:
        MissionError: it is wrong.
    """
    mission = load_mission(arguments.mission, overrides_of(arguments))
    refuse_unknown_criteria(mission)
    for remark in mission.remarks:
        complain("warning:", remark)
    flies = drawn(mission)
    for line in flies.lines():
        errors.print(f"drawn for case {mission.values.mission.case}: {line}", soft_wrap=True)
    return flies.mission
