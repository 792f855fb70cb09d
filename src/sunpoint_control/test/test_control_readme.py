# SPDX-License-Identifier: Apache-2.0
"""The README's tables say what the nodes declare."""

from pathlib import Path

import pytest

from css_common.schema import default_values
from sunpoint_control.nodes.mrp_control import MrpControl

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
COMPONENTS = (MrpControl,)


def rows(text):
    """Cells of the table rows of a text by what the first cell names."""
    lines = [line for line in text.splitlines() if line.startswith("| `")]
    cells = [[c.strip() for c in line.split("|")[1:-1]] for line in lines]
    return {row[0].strip("`* "): row for row in cells}


SECTIONS = {part.split("\n", 1)[0].strip(): rows(part) for part in README.split("### ")[1:]}


@pytest.mark.parametrize("kind", COMPONENTS)
def test_parameters(kind):
    table = SECTIONS[kind.__module__.rpartition(".")[2]]
    for parameter in kind.parameters:
        name, default, unit, _, meaning = table.pop(parameter.name)
        assert name.endswith("*") == parameter.tunable, parameter.name
        assert unit == parameter.unit, parameter.name
        assert meaning == parameter.description, parameter.name
        if parameter.kind == "real":
            assert float(default) == parameter.default, parameter.name


@pytest.mark.parametrize("kind", COMPONENTS)
def test_topics(kind):
    name = kind.__module__.rpartition(".")[2]
    values = default_values(kind.table(), rods__fitted=True)
    for port in (*kind.inputs(name, values), *kind.outputs(name, values)):
        package = port.message_type.__module__.split(".")[0]
        assert rows(README)[port.topic][1] == f"`{package}/{port.message_type.__name__}`"
