# SPDX-License-Identifier: Apache-2.0
"""Transitions of a hosted component, by call, by service and by wrong requests: no request ends the node."""

import numpy as np
import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from sensor_msgs.msg import Imu

from css_common.codec import codec_of
from css_common.host import ComponentNode
from css_common.mission import find_component
from css_common.testing import Bench
from css_msgs.msg import CssVoltages, SpacecraftState, SunEstimate

TEXT = """\
/**:
  ros__parameters:
    mission: {epoch: '2013-06-01T00:00:00Z', duration: 10.0}
    graph: {nodes: [testbed/source, testbed/gyro, testbed/estimator]}
estimator:
  ros__parameters: {use_gyro: false}
"""
T0 = 1_370_044_800_000_000_000
STEP = 100_000_000


def host(bench: Bench, mission, *overrides: str, name: str = "estimator", start: bool = False) -> ComponentNode:
    """A node of the mission, not yet started."""
    return bench.host(find_component("testbed", name), mission(*overrides, text=TEXT), name, start=start)


def state(bench: Bench, name: str = "estimator") -> str:
    """What the node says its state is."""
    return bench.request(GetState, f"{name}/get_state", GetState.Request()).current_state.label


def change(bench: Bench, transition: int = 0, label: str = "") -> bool:
    """Whether the node granted a transition."""
    request = ChangeState.Request(transition=Transition(id=transition, label=label))
    return bench.request(ChangeState, "estimator/change_state", request).success


def voltages(step: int):
    """A message of voltages of a step."""
    return codec_of(CssVoltages).sample(T0 + step * STEP, "bus", voltages=np.ones(2))


def test_node_configures_and_activates_by_itself(bench, mission):
    host(bench, mission, start=True)
    assert state(bench) == "active"


def test_without_autostart_it_waits_to_be_asked(bench, mission):
    node = host(bench, mission, "estimator.autostart=false", start=True)
    assert state(bench) == "unconfigured"
    assert not node.edges
    for transition, expected in (
        (Transition.TRANSITION_CONFIGURE, "inactive"),
        (Transition.TRANSITION_ACTIVATE, "active"),
        (Transition.TRANSITION_DEACTIVATE, "inactive"),
        (Transition.TRANSITION_CLEANUP, "unconfigured"),
        (Transition.TRANSITION_CONFIGURE, "inactive"),
        (Transition.TRANSITION_INACTIVE_SHUTDOWN, "finalized"),
    ):
        assert change(bench, transition)
        assert state(bench) == expected


WRONG = {
    "id of no transition": {"transition": 200},
    "id that does not fit the state": {"transition": Transition.TRANSITION_CONFIGURE},
    "id of another state's shutdown": {"transition": Transition.TRANSITION_UNCONFIGURED_SHUTDOWN},
    "id of a result": {"transition": Transition.TRANSITION_ON_CONFIGURE_SUCCESS},
    "id of creation": {"transition": Transition.TRANSITION_CREATE},
    "id of destruction": {"transition": Transition.TRANSITION_DESTROY},
    "label of no transition": {"label": "explode"},
    "label that does not fit the state": {"label": "configure"},
    "label of a result": {"label": "transition_success"},
    "empty request": {},
}


@pytest.mark.parametrize("wrong", WRONG)
def test_wrong_request_is_refused_and_the_node_flies_on(bench, mission, wrong):
    estimates = bench.listen("estimator/sun_estimate", SunEstimate)
    host(bench, mission, start=True)
    bench.publish("voltages", CssVoltages, voltages(0))
    bench.until(lambda: len(estimates) == 1, "an estimate before the request")
    assert not change(bench, **WRONG[wrong])
    assert state(bench) == "active"
    bench.publish("voltages", CssVoltages, voltages(1))
    bench.until(lambda: len(estimates) == 2, "an estimate after the request")


def test_wrong_requests_in_every_state_change_nothing(bench, mission):
    node = host(bench, mission)
    for expected, step in (("unconfigured", node.trigger_configure), ("inactive", node.trigger_activate)):
        assert state(bench) == expected
        assert not change(bench, Transition.TRANSITION_DEACTIVATE)
        assert not change(bench, label="nonsense")
        assert state(bench) == expected
        step()
    assert state(bench) == "active"
    node.trigger_shutdown()
    assert state(bench) == "finalized"
    refused = node.counters["lifecycle_refused"]
    assert refused == 2  # labels that do not exist are answered without the node
    for transition in range(1, 8):
        assert not change(bench, transition)
    assert state(bench) == "finalized"
    assert node.counters["lifecycle_refused"] == refused + 7


def test_labels_work_as_ids_do(bench, mission):
    host(bench, mission)
    assert change(bench, label="configure")
    assert change(bench, label="activate")
    assert state(bench) == "active"


def test_exception_in_configure_is_logged_with_its_traceback_and_can_be_mended(bench, mission):
    node = host(bench, mission, "estimator.fault=configure")
    assert not node.start()
    assert state(bench) == "unconfigured"
    bench.until(lambda: bench.logged("RuntimeError: no such table"), "the traceback is logged")
    assert bench.logged("configure failed")
    assert not change(bench, Transition.TRANSITION_CONFIGURE)
    node.set_parameters([node.get_parameter("fault").__class__("fault", value="none")])
    assert change(bench, Transition.TRANSITION_CONFIGURE)
    assert change(bench, Transition.TRANSITION_ACTIVATE)
    assert state(bench) == "active"


def test_refusal_in_configure_is_one_line(bench, mission):
    node = host(bench, mission, "estimator.fault=refuse")
    assert not node.start()
    assert state(bench) == "unconfigured"
    bench.until(lambda: bench.logged("fault: refused on demand"), "the reason is logged")
    assert not bench.logged("Traceback")


def test_failed_configure_leaves_no_topics_behind(bench, mission):
    node = host(bench, mission, "estimator.fault=configure")
    assert not node.start()
    assert not node.edges
    assert bench.node.count_publishers("estimator/sun_estimate") == 0
    assert bench.node.count_subscribers("voltages") == 0


def test_deactivated_node_is_silent_and_begins_anew(bench, mission):
    estimates = bench.listen("estimator/sun_estimate", SunEstimate)
    node = host(bench, mission, start=True)

    def feed(step: int) -> None:
        cycles = node.counters["cycles"]
        bench.publish("voltages", CssVoltages, voltages(step))
        bench.until(lambda: node.counters["cycles"] == cycles + 1, "the message went through")

    feed(0)
    feed(1)
    assert change(bench, Transition.TRANSITION_DEACTIVATE)
    feed(2)
    assert node.health()[1] == "inactive"
    assert change(bench, Transition.TRANSITION_ACTIVATE)
    feed(3)
    # step 2 came while it was off: in lockstep time stands still for it, so it is made up for
    bench.until(lambda: len(estimates) == 4, "four estimates")
    assert [(e.stamp_ns - T0) // STEP for e in estimates] == [0, 1, 2, 3]
    assert [e.nis for e in estimates] == [1.0, 2.0, 1.0, 2.0]
    # the activation at the start is none after a pause
    assert (node.counters["deactivated"], node.counters["reactivated"]) == (1, 1)


def test_node_that_nothing_waits_for_leaves_out_what_came_while_it_was_off(bench, mission):
    estimates = bench.listen("estimator/sun_estimate", SunEstimate)
    node = host(bench, mission, "lockstep.realtime_factor=1", start=True)
    for step, transition in enumerate((node.trigger_deactivate, node.trigger_activate, lambda: None)):
        cycles = node.counters["cycles"]
        bench.publish("voltages", CssVoltages, voltages(step))
        bench.until(lambda: node.counters["cycles"] == cycles + 1, "the message went through")  # noqa: B023
        transition()
    bench.until(lambda: len(estimates) == 2, "two estimates")
    assert [(e.stamp_ns - T0) // STEP for e in estimates] == [0, 2]


def test_what_a_component_says_while_it_is_off_goes_on(bench, mission):
    rates = bench.listen("gyro/imu", Imu)
    node = host(bench, mission, name="gyro", start=True)
    truth = codec_of(SpacecraftState)
    bench.publish("truth", SpacecraftState, truth.sample(T0, "eci"))
    bench.until(lambda: len(rates) == 1, "a rate")
    node.trigger_deactivate()
    bench.publish("truth", SpacecraftState, truth.sample(T0 + STEP, "eci"))
    bench.until(lambda: len(rates) == 2, "no rate")
    assert [r.angular_velocity_covariance[0] for r in rates] == [0.0, -1.0]


def test_cleaned_up_node_gives_its_topics_up_and_takes_them_again(bench, mission):
    estimates = bench.listen("estimator/sun_estimate", SunEstimate)
    node = host(bench, mission, start=True)
    bench.publish("voltages", CssVoltages, voltages(0))
    bench.until(lambda: len(estimates) == 1, "an estimate")
    node.trigger_deactivate()
    node.trigger_cleanup()
    assert node.component is None
    bench.until(lambda: bench.node.count_publishers("estimator/sun_estimate") == 0, "the topic is free")
    assert node.health()[1] == "inactive"
    assert node.start()
    bench.publish("voltages", CssVoltages, voltages(1))
    bench.until(lambda: len(estimates) >= 2, "an estimate after that")


def test_destroyed_node_gives_its_name_free_at_once(bench, mission):
    node = host(bench, mission, start=True)
    bench.remove(node)
    bench.until(lambda: "estimator" not in bench.node.get_node_names(), "the name is free, garbage collected or not")
