# SPDX-License-Identifier: Apache-2.0
"""The spacecraft, cells and orbit of O'Keefe & Schaub 2013, for tests of algorithms that need some."""

from pathlib import Path

from css_common.mission_extends import sections_of_file
from css_common.schema import Values, default_values

MISSION_FILE = Path(__file__).parents[1] / "config" / "okeefe_2013.yaml"
STATED = {
    name.replace(".", "__"): value
    for name, value in sections_of_file(MISSION_FILE)["/**"].items()
    if name.split(".")[0] in ("orbit", "spacecraft", "cells", "wheels") or name in ("mission.epoch", "mission.duration")
}
"""What its mission says of them, by the names that `default_values` takes."""


def okeefe_values(table, **changes) -> Values:
    """Values of a table: its defaults, and what this spacecraft has in their place."""
    table = tuple(table)
    names = {parameter.name.replace(".", "__") for parameter in table}
    return default_values(table, **({name: STATED[name] for name in names & STATED.keys()} | changes))
