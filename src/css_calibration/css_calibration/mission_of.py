# SPDX-License-Identifier: Apache-2.0
"""The recording that a command names, with the mission whose cells it holds."""

import argparse

from css_calibration.recorded import Recorded, read_recorded
from css_common.mission import load_mission
from css_common.mission_file import MissionError


def recorded_by(options: argparse.Namespace) -> Recorded:
    """The recording of the options bag, mission, overrides and remap.

    Raises:
        MissionError, BagError, CalibrationError: as `read_recorded`.
    """
    remap = remapping(options)
    mission = load_mission(options.mission, options.overrides) if options.mission is not None else None
    recorded = read_recorded(options.bag, mission, remap)
    if options.mission is None and options.overrides:
        changed = recorded.mission.with_overrides(options.overrides)
        recorded = read_recorded(options.bag, changed, remap)
    return recorded


def remapping(options: argparse.Namespace) -> dict[str, str]:
    """New names of the recording's topics.

    Raises:
        MissionError: the option has another form.
    """
    return dict(_remapping(item) for item in options.remap)


def _remapping(text: str) -> tuple[str, str]:
    old, separator, new = text.partition(":=")
    if not separator or not old or not new:
        raise MissionError(f"--remap {text!r}: expected OLD:=NEW")
    return old, new
