# SPDX-License-Identifier: Apache-2.0
"""Each node of each mission is cleaned up and configured again while the flight goes on around it."""

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from listing import MISSIONS
from presence import present
from rclpy.lifecycle import TransitionCallbackReturn

from css_common.mission import load_mission
from css_common.plant_host import PlantNode
from css_common.testing import Bench


@pytest.mark.parametrize("name", MISSIONS)
def test_every_partner_of_the_plant(name):
    mission = load_mission(name)
    mission = mission.with_overrides([f"mission.duration={100 * mission.values.mission.period!r}"])
    with Bench() as bench:
        nodes = bench.host_all(mission)
        plant = nodes.pop(present(mission.plant).name)
        assert isinstance(plant, PlantNode)
        for node in nodes.values():
            at = plant.stamp_ns
            bench.until(lambda: plant.done or plant.stamp_ns > at, "the flight goes on")  # noqa: B023
            assert not plant.done, "each partner has its turn in the flight"
            for transition in (node.trigger_deactivate, node.trigger_cleanup, node.trigger_configure):
                assert transition() == TransitionCallbackReturn.SUCCESS
                bench.executor.spin_once(timeout_sec=0.0)  # what is on its way comes in between
            assert node.trigger_activate() == TransitionCallbackReturn.SUCCESS
        bench.until(lambda: plant.done, "the flight has ended")
        assert plant.failed == ""
        assert plant.counters["partners_lost"] == 0
        assert plant.counters["cycles"] == 100
        assert not bench.logged("Traceback")
        assert all(node.health().level != DiagnosticStatus.ERROR for node in nodes.values())
