# SPDX-License-Identifier: Apache-2.0
"""The tables in the READMEs of packages say what the nodes declare."""

import pytest
from listing import ROOT, components, executable, with_every_flag

from css_common.component import INERTIAL
from css_common.readme_parameters import documented, rewritten
from css_common.schema import default_values

KINDS = pytest.mark.parametrize("kind", components(), ids=executable)


def rows(text):
    """Cells of the table rows of a text by what the first cell names."""
    lines = [line.replace("\\|", "/") for line in text.splitlines() if line.startswith("| `")]
    cells = [[c.strip() for c in line.split("|")[1:-1]] for line in lines]
    return {row[0].strip("`* "): row for row in cells}


def readme(kind):
    """Text of the README of a component's package."""
    return (ROOT / "src" / kind.__module__.split(".")[0] / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("package", sorted({kind.__module__.split(".")[0] for kind in components()}))
def test_parameters_are_those_of_the_nodes(package):
    text = (ROOT / "src" / package / "README.md").read_text(encoding="utf-8")
    command = "./sunpoint shell -c 'python -m css_common.readme_parameters src/*/README.md'"
    assert rewritten(text, package) == text, f"{command} writes them anew"
    kinds = [kind for kind in components() if kind.__module__.split(".")[0] == package]
    assert [executable(k) for k in kinds if k.parameters and executable(k) not in documented(text)] == []


@KINDS
def test_topics(kind):
    name = executable(kind)
    for values in (default_values(kind.table()), default_values(kind.table(), **with_every_flag(kind))):
        described = rows(readme(kind))
        for port in (*kind.inputs(name, values), *kind.outputs(name, values)):
            package = port.message_type.__module__.split(".")[0]
            row = described[port.topic]
            assert row[1] == f"`{package}/{port.message_type.__name__}`"
            frame_id = values.io.inertial_frame if port.frame == INERTIAL else values.io.body_frame
            assert f"(`{frame_id}`)" in row[4], port.topic
