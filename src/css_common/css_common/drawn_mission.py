# SPDX-License-Identifier: Apache-2.0
"""The mission that a case flies where parameters are dispersed: drawn values in the place of the mission's own."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from css_common.dispersions import drawn_value
from css_common.mission import SHARED, Mission, MissionError
from css_common.sampling import sample_of
from css_common.schema import ParameterError


class Drawn(NamedTuple):
    """What a case flies.

    Attributes:
        mission: without dispersions.
        values: drawn values in canonical form, by the key of the parameter.
    """

    mission: Mission
    values: dict[str, Any]

    def lines(self) -> list[str]:
        """What was drawn, one line each."""
        return assignments(self.values)


def assignments(values: Mapping[str, Any]) -> list[str]:
    """Drawn values in words, one line each."""
    return [f"{key} = {_text(value)}" for key, value in values.items()]


def drawn(mission: Mission) -> Drawn:
    """The mission of `mission.case`; the same one where nothing is dispersed.

    Raises:
        MissionError: a draw that a parameter refuses, values that do not go together, or no such case of the design.
    """
    if not mission.dispersions:
        return Drawn(mission, {})
    values, own_case = drawn_values(mission, mission.values.mission.case)
    try:
        return Drawn(mission.with_drawn(values, own_case), values)
    except MissionError as error:
        raise MissionError(f"case {mission.values.mission.case} draws what cannot fly: {error}") from error


def drawn_values(mission: Mission, case: int) -> tuple[dict[str, Any], int]:
    """Values that a case draws, by key, and the case whose draws of other kinds it flies.

    Raises:
        MissionError: a draw that a parameter refuses, or no such case of the design.
    """
    try:
        sample = sample_of(mission.dispersions, mission.values.sampling, mission.values.mission.seed, case)
        return values_at(mission, sample.points), sample.own_case
    except ParameterError as error:
        raise MissionError(f"{mission.origin}: {SHARED}: case {case}: {error}") from error


def values_at(mission: Mission, points: Any) -> dict[str, Any]:
    """Values of the dispersed parameters by key, from numbers (D,) above 0 and below 1.

    Raises:
        ParameterError: a parameter refuses one.
    """
    values: dict[str, Any] = {}
    at = 0
    for one in mission.dispersions:
        _, parameter, own = mission.known(one.key)
        draws = [float(u) for u in points[at : at + one.draws]]
        values[one.key] = drawn_value(one, parameter, values.get(one.key, own), draws)
        at += one.draws
    return values


def _text(value: Any) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(_text(item) for item in value) + "]"
    if isinstance(value, float):
        return f"{value:.6g}"
    return value if isinstance(value, str) else str(value).lower()
