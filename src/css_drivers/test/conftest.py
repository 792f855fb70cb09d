# SPDX-License-Identifier: Apache-2.0
"""Drivers in their nodes, in a ROS context of their own; lets tests import the helper `chip_models` beside them."""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from css_common.mission import Mission, mission_from_text
from css_common.testing import Bench

sys.path.insert(0, str(Path(__file__).parent))

MISSION = """\
/**:
  ros__parameters:
    mission: {{name: drivers, period: 0.02}}
    cells: {{normals: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]}}
    wheels: {{fitted: false}}
    graph: {{nodes: [css_drivers/{executable}]}}
{executable}:
  ros__parameters: {{{parameters}}}
"""


@pytest.fixture
def mission() -> Callable[..., Mission]:
    """The mission of one driver with three cells."""
    return lambda executable, parameters="": mission_from_text(
        MISSION.format(executable=executable, parameters=parameters), "drivers.yaml"
    )


@pytest.fixture(params=["events", "draining"])
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    """Nodes in this process, with either executor."""
    with Bench(request.param) as bench:
        yield bench
