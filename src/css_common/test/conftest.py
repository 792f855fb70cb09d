# SPDX-License-Identifier: Apache-2.0
"""The made-up package of components, missions of it, and nodes in a ROS context of their own."""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from css_common.mission import Mission, mission_from_text
from css_common.testing import Bench

sys.path.insert(0, str(Path(__file__).parent / "workspace"))

MISSION = """\
/**:
  ros__parameters:
    mission: {name: bench, duration: 1.0, period: 0.1, epoch: "2013-06-01T00:00:00Z"}
    graph:
      nodes: [testbed/source, testbed/gyro, testbed/estimator, testbed/controller]
      estimator: estimator
"""


@pytest.fixture
def mission_text() -> str:
    """A mission of four nodes and ten steps."""
    return MISSION


@pytest.fixture
def mission() -> Callable[..., Mission]:
    """Missions of the made-up package: the small one with overrides, or that of another text."""

    def build(*overrides: str, text: str = MISSION) -> Mission:
        return mission_from_text(text, "bench.yaml", overrides)

    return build


@pytest.fixture(params=["events", "draining"])
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    """Nodes in this process, with either executor."""
    with Bench(request.param) as bench:
        yield bench
