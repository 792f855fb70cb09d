# SPDX-License-Identifier: Apache-2.0
"""From what was asked to a mission that every check has passed."""

import math
import time
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from css_common.epochs import parse_utc
from css_common.mission import Mission, mission_from_text
from css_common.mission_file import MissionError
from css_common.preflight import preflight
from css_design.errors import DesignError
from css_design.new_mission.design import Design, design, with_gains
from css_design.new_mission.items import ITEMS
from css_design.new_mission.mission_text import mission_text
from css_design.new_mission.templates import TEMPLATES
from css_environment.tle_checks import USELESS_DAYS
from sunpoint_control.control_checks import loop_model

_DIRECTIONS = 4000
_DAY_NS = 86_400 * 10**9
_LONG_DAYS = 730.0  # from which on years are told


class NewMission(NamedTuple):
    """A mission that may be written."""

    design: Design
    text: str
    mission: Mission
    warnings: tuple[str, ...]


def read_items(given: Mapping[str, str], template: str) -> tuple[dict[str, Any], dict[str, str]]:
    """Values of all items, and where each is from.

    Args:
        given: texts of the items that somebody gave.
        template: name of that which gives the rest.

    Raises:
        DesignError: there is no such template, or a text is wrong.
    """
    if template not in TEMPLATES:
        raise DesignError(f"--template: {template!r} given, expected one of {', '.join(TEMPLATES)}")
    texts = {item.name: given.get(item.name, TEMPLATES[template].values[item.name]) for item in ITEMS}
    origin = {item.name: "given" if item.name in given else template for item in ITEMS}
    return {item.name: item.read(texts[item.name]) for item in ITEMS}, origin


def new_mission(
    name: str, asked: Mapping[str, Any], origin: Mapping[str, str], today_ns: int | None = None
) -> NewMission:
    """A mission of what was asked, checked as before a flight.

    Args:
        name: of the mission.
        asked: value of each item.
        origin: where each is from.
        today_ns: UTC since 1970; None: by the clock of this machine.

    Raises:
        DesignError: it cannot fly; says why.
    """
    known = design(name, asked, origin)
    place = f"{name}.yaml"
    try:
        mission = mission_from_text(mission_text(known), place)
        if known.wheels is not None:
            control = mission.node("mrp_control")
            known = with_gains(known, loop_model(control.values, {node.name: node for node in mission.nodes}))
            mission = mission_from_text(mission_text(known), place)
        warnings = preflight(mission)
    except MissionError as error:
        raise DesignError(str(error).removeprefix(f"{place}: ")) from error
    return NewMission(
        known, mission_text(known), mission, (*warnings, *_blind(known), *_of_another_time(known, today_ns))
    )


def _of_another_time(known: Design, today_ns: int | None) -> Iterator[str]:
    """A warning for an epoch that nobody named, taken from an element set that is not of these days."""
    if known.asked["epoch"] != "auto" or known.orbit.parameters["source"] != "tle":
        return
    days = ((time.time_ns() if today_ns is None else today_ns) - parse_utc(known.orbit.epoch)) / _DAY_NS
    if abs(days) > USELESS_DAYS:
        apart = f"{abs(days):.0f} days" if abs(days) < _LONG_DAYS else f"{abs(days) / 365.25:.1f} years"
        yield (
            f"--epoch: auto takes that of the element set, {known.orbit.epoch}, {apart} "
            f"{'ago' if days > 0.0 else 'ahead'}: the flight is of then, with its Sun, Earth and field; expected a set "
            f"of the days of the flight, or --epoch {known.orbit.epoch}"
        )


def _blind(known: Design) -> Iterator[str]:
    """A warning for cells that leave part of the sky unseen."""
    index = np.arange(_DIRECTIONS) + 0.5
    z, azimuth = 1.0 - 2.0 * index / _DIRECTIONS, np.pi * (3.0 - np.sqrt(5.0)) * index
    across = np.sqrt(1.0 - z**2)
    sky = np.stack([across * np.cos(azimuth), across * np.sin(azimuth), z], axis=1)
    seen = sky @ np.array(known.normals).T > math.cos(math.radians(0.5 * known.asked["field_of_view"]))
    unseen = float(np.mean(~seen.any(axis=1)))
    if unseen > 0.0:
        yield (
            f"--cells: no cell sees {100.0 * unseen:.1f} % of the sky, where the Sun is looked for by turning: "
            "expected cells that look all around"
        )
