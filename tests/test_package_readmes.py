# SPDX-License-Identifier: Apache-2.0
"""The tables in the READMEs of packages say what the nodes declare."""

from pathlib import Path

import pytest

from css_common.component import INERTIAL
from css_common.node_files import find_component
from css_common.readme_parameters import documented, rewritten
from css_common.schema import default_values
from css_estimation.nodes.attitude_filter import AttitudeFilter
from css_estimation.nodes.coning import Coning
from css_estimation.nodes.ekf import Ekf
from css_estimation.nodes.flat import Flat
from css_estimation.nodes.pyramid_switch import PyramidSwitch
from css_estimation.nodes.slit_sun_angle import SlitPassages
from css_estimation.nodes.triad import Triad
from css_estimation.nodes.wavg import Wavg
from css_estimation.nodes.wls import Wls
from sunpoint_control.nodes.mrp_control import MrpControl

SOURCES = Path(__file__).parents[1] / "src"
PACKAGES = ("css_sim", "css_estimation", "sunpoint_control")
# component, and the parameters with which it shows all of its topics
COMPONENTS = (
    (AttitudeFilter, {}),
    (Ekf, {"rate__use_field": True}),
    (Wavg, {}),
    (Wls, {}),
    (Flat, {}),
    (PyramidSwitch, {}),
    (SlitPassages, {}),
    (Triad, {}),
    (Coning, {}),
    (MrpControl, {"rods__fitted": True}),
)


def rows(text):
    """Cells of the table rows of a text by what the first cell names."""
    lines = [line for line in text.splitlines() if line.startswith("| `")]
    cells = [[c.strip() for c in line.split("|")[1:-1]] for line in lines]
    return {row[0].strip("`* "): row for row in cells}


def readme(kind):
    """Text of the README of a component's package."""
    return (SOURCES / kind.__module__.split(".")[0] / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("package", PACKAGES)
def test_parameters_are_those_of_the_nodes(package):
    text = (SOURCES / package / "README.md").read_text(encoding="utf-8")
    command = "./sunpoint shell -c 'python -m css_common.readme_parameters src/*/README.md'"
    assert rewritten(text, package) == text, f"{command} writes them anew"
    nodes = [file.stem for file in sorted((SOURCES / package / package / "nodes").glob("[!_]*.py"))]
    assert [node for node in nodes if find_component(package, node).parameters and node not in documented(text)] == []


@pytest.mark.parametrize(("kind", "shown"), COMPONENTS)
def test_topics(kind, shown):
    name = kind.__module__.rpartition(".")[2]
    values = default_values(kind.table(), **shown)
    for port in (*kind.inputs(name, values), *kind.outputs(name, values)):
        package = port.message_type.__module__.split(".")[0]
        row = rows(readme(kind))[port.topic]
        assert row[1] == f"`{package}/{port.message_type.__name__}`"
        frame_id = values.io.inertial_frame if port.frame == INERTIAL else values.io.body_frame
        assert f"(`{frame_id}`)" in row[4], port.topic
