# SPDX-License-Identifier: Apache-2.0
"""Asks a person for what the options left open, a line each, with units and what is taken for an empty answer."""

from collections.abc import Callable, Mapping

from css_design.errors import DesignError
from css_design.new_mission.items import ITEMS, Item
from css_design.new_mission.templates import TEMPLATES
from css_design.new_mission.values import NONE

_OF_WHEELS = ("wheel_momentum", "wheel_torque", "wheel_speed")
_OF_GYRO = ("gyro_bias",)


def ask(
    given: Mapping[str, str], template: str, read_line: Callable[[str], str], say: Callable[[str], None]
) -> dict[str, str]:
    """Answers for the items that nobody gave; those left empty are not among them.

    Args:
        given: texts of the items that were.
        template: what an empty answer takes.
        read_line: shows a prompt and gives the answer.
        say: shows a line.

    Raises:
        EOFError: nobody answers any more.
    """
    answers: dict[str, str] = {}
    for item in ITEMS:
        known = {**TEMPLATES[template].values, **given, **answers}
        if item.name not in given and not _is_idle(item, known):
            answer = _answer(item, TEMPLATES[template].values[item.name], read_line, say)
            if answer:
                answers[item.name] = answer
    return answers


def _is_idle(item: Item, known: Mapping[str, str]) -> bool:
    """Whether it is about something that the spacecraft does not have."""
    return (item.name in _OF_WHEELS and known["wheels"] == NONE) or (item.name in _OF_GYRO and known["gyro"] == NONE)


def _answer(item: Item, default: str, read_line: Callable[[str], str], say: Callable[[str], None]) -> str:
    unit = f" [{item.unit}]" if item.unit else ""
    say(f"{item.question}{unit}: {item.form}")
    while True:
        answer = read_line(f"  {item.name.replace('_', ' ')}{unit} ({default}): ").strip()
        if not answer:
            return ""
        try:
            item.read(answer)
        except DesignError as error:
            say(f"  {error}")
            continue
        return answer
