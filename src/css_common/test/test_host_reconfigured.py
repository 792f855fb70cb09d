# SPDX-License-Identifier: Apache-2.0
"""Clean-up and a new start of a node while messages stream: nothing is torn, nothing of the old start stays."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState

from css_common.codec import codec_of
from css_common.component import Component
from css_common.mission import find_component
from css_common.testing import Bench
from css_msgs.msg import CssVoltages, SunEstimate

TEXT = """\
/**:
  ros__parameters:
    mission: {duration: 10.0, epoch: '2013-06-01T00:00:00Z'}
    graph: {nodes: [testbed/source, testbed/gyro, testbed/estimator]}
estimator:
  ros__parameters: {use_gyro: false}
"""
T0 = 1_370_044_800_000_000_000
STEP = 100_000_000
ROUND = (
    Transition.TRANSITION_DEACTIVATE,
    Transition.TRANSITION_CLEANUP,
    Transition.TRANSITION_CONFIGURE,
    Transition.TRANSITION_ACTIVATE,
)


def kind(name: str) -> type[Component]:
    """A component of the made-up package."""
    return find_component("testbed", name)


def voltages(step: int, cells: int = 2):
    """A message of voltages of a step."""
    return codec_of(CssVoltages).sample(T0 + step * STEP, "bus", voltages=np.ones(cells))


def change(bench: Bench, name: str, transition: int) -> bool:
    """Whether the node granted a transition."""
    request = ChangeState.Request(transition=Transition(id=transition))
    return bench.request(ChangeState, f"{name}/change_state", request).success


def test_messages_that_were_under_way_to_a_node_that_was_cleaned_up_do_no_harm(bench, mission):
    node = bench.host(kind("estimator"), mission(text=TEXT), "estimator")
    (late,) = [subscription._callback for subscription in node.subscriptions_made]
    data = codec_of(CssVoltages).encode(voltages(0))
    node.trigger_deactivate()
    node.trigger_cleanup()
    late(data)
    assert node.start()
    late(data)  # not for this start: its edge and matcher are gone
    assert node.counters["cycles"] == node.counters["cycle_failed"] == 0
    assert node.matcher.unmatched == 0
    assert node.health().level == DiagnosticStatus.OK


@pytest.mark.parametrize("name", ["estimator", "source"])
def test_timers_that_were_under_way_do_no_harm(bench, mission, name):
    # both executors may have a firing of a timer in their queue when it is destroyed
    node = bench.host(kind(name), mission("lockstep.realtime_factor=1", "lockstep.publish_clock=true"), name)
    late = [timer.callback for timer in node.timers]
    assert len(late) >= 2
    node.trigger_deactivate()
    node.trigger_cleanup()
    for callback in late:
        callback()
    assert node.start()
    assert node.health().level == DiagnosticStatus.OK


def test_what_failed_before_a_clean_up_is_no_error_of_the_next_start(bench, mission):
    node = bench.host(kind("estimator"), mission("estimator.fault=raise", text=TEXT), "estimator")
    reports: list[DiagnosticArray] = []
    bench.node.create_subscription(DiagnosticArray, "/diagnostics", reports.append, 10)
    bench.publish("voltages", CssVoltages, voltages(0))
    bench.until(lambda: node.counters["cycle_failed"] == 1, "the cycle has failed")
    assert node.health().level == DiagnosticStatus.ERROR
    node.trigger_deactivate()
    node.trigger_cleanup()
    node.set_parameters([node.get_parameter("fault").__class__("fault", value="none")])
    assert node.start()
    assert node.health().level == DiagnosticStatus.OK
    assert node.health().counters["cycle_failed"] == 1, "it has happened all the same"
    bench.until(lambda: reports and reports[-1].status[0].level == DiagnosticStatus.OK, "the report says so")
    node.set_parameters([node.get_parameter("fault").__class__("fault", value="raise")])
    bench.publish("voltages", CssVoltages, voltages(1))
    bench.until(lambda: node.counters["cycle_failed"] >= 2, "the cycle has failed again")
    assert node.health().level == DiagnosticStatus.ERROR


def test_rejections_before_a_clean_up_are_forgotten(bench, mission):
    node = bench.host(kind("estimator"), mission(text=TEXT), "estimator")
    bench.publish("voltages", CssVoltages, voltages(0, cells=3))
    bench.until(lambda: node.health().level == DiagnosticStatus.WARN, "the message is rejected")
    node.trigger_deactivate()
    node.trigger_cleanup()
    assert node.health().level == DiagnosticStatus.OK
    assert node.start()
    assert node.edges["voltages"].guard.last is None or node.edges["voltages"].rejected


def test_fifty_rounds_while_messages_stream(bench, mission):
    estimates = bench.listen("estimator/sun_estimate", SunEstimate)
    node = bench.host(kind("estimator"), mission(text=TEXT), "estimator")
    step = 0
    for _ in range(50):
        for transition in ROUND:
            for _ in range(3):  # not waited for: they are in queues and on their way when the transition comes
                bench.publish("voltages", CssVoltages, voltages(step), listened_to=False)
                step += 1
            assert change(bench, "estimator", transition)
    seen = len(estimates)
    bench.publish("voltages", CssVoltages, voltages(step))
    bench.until(lambda: len(estimates) > seen and estimates[-1].stamp_ns == T0 + step * STEP, "it flies on")
    assert node.health().level == DiagnosticStatus.OK
    assert not bench.logged("Traceback")
    assert bench.node.count_publishers("estimator/sun_estimate") == 1
    assert bench.node.count_subscribers("voltages") == 1


def test_shutdown_while_messages_stream(bench, mission):
    node = bench.host(kind("estimator"), mission(text=TEXT), "estimator")
    for step in range(10):
        bench.publish("voltages", CssVoltages, voltages(step))
    assert change(bench, "estimator", Transition.TRANSITION_ACTIVE_SHUTDOWN)
    bench.until(lambda: bench.node.count_subscribers("voltages") == 0, "its topics are given up")
    assert node.health().level == DiagnosticStatus.OK
    assert not bench.logged("Traceback")


def test_configure_that_is_refused_half_way_leaves_no_topics(bench, mission):
    node = bench.host(kind("estimator"), mission(text=TEXT), "estimator", start=False)
    override = "qos_overrides./voltages.subscription.durability"
    node._parameter_overrides[override] = node.get_parameter("note").__class__(override, value="bogus")
    for _ in range(2):
        assert not change(bench, "estimator", Transition.TRANSITION_CONFIGURE)
        assert bench.node.count_publishers("estimator/sun_estimate") == 0
    bench.until(lambda: bench.logged("voltages: Unexpected QoS override"), "the reason is logged")
    assert not bench.logged("Traceback")


def test_flight_whose_partners_are_cleaned_up_in_it_goes_on(bench, mission):
    nodes = bench.host_all(mission("mission.duration=4"))
    plant = nodes["source"]
    rounds = 0
    while not plant.done:
        for name in ("estimator", "controller", "gyro"):
            for transition in ROUND:
                assert change(bench, name, transition)
            rounds += 1
            stamp = plant.stamp_ns
            bench.until(lambda: plant.done or plant.stamp_ns > stamp, "the flight goes on")  # noqa: B023
    assert rounds >= 3
    assert plant.failed == ""
    assert plant.counters["partners_lost"] == 0
    assert not bench.logged("Traceback")
    assert all(node.health().level != DiagnosticStatus.ERROR for node in nodes.values())
