# SPDX-License-Identifier: Apache-2.0
"""The README's topic tables say what the nodes declare."""

from pathlib import Path

import pytest

from css_common.component import INERTIAL
from css_common.schema import default_values
from css_sim.nodes.css_array import CssArray
from css_sim.nodes.dynamics import Dynamics
from css_sim.nodes.gyro import Gyro
from css_sim.nodes.magnetometer import Magnetometer
from css_sim.nodes.rocket import Rocket
from css_sim.nodes.slit_sensor import SlitSensor

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


def rows(text):
    """Cells of the table rows of a text by what the first cell names."""
    lines = [line.replace("\\|", "/") for line in text.splitlines() if line.startswith("| `")]
    cells = [[c.strip() for c in line.split("|")[1:-1]] for line in lines]
    return {row[0].strip("`* "): row for row in cells}


COMPONENTS = (Dynamics, CssArray, Gyro, Magnetometer, Rocket, SlitSensor)


@pytest.mark.parametrize("kind", COMPONENTS)
def test_topics(kind):
    values = default_values(kind.table())
    for output in kind.outputs("x", values):
        package = output.message_type.__module__.split(".")[0]
        row = rows(README)[output.topic]
        assert row[1] == f"`{package}/{output.message_type.__name__}`"
        frame_id = values.io.inertial_frame if output.frame == INERTIAL else values.io.body_frame
        assert f"(`{frame_id}`)" in row[4], output.topic
