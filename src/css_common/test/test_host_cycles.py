# SPDX-License-Identifier: Apache-2.0
"""Cycles of a hosted component: what comes in, what goes out, what is withheld, and that nothing ends the node."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from sensor_msgs.msg import Imu

from css_common.codec import codec_of
from css_common.component import Component
from css_common.link import GAP
from css_common.mission import find_component
from css_common.schema import default_values
from css_common.testing import Bench
from css_msgs.msg import CssVoltages, SunEstimate

ALONE = """\
/**:
  ros__parameters:
    mission: {epoch: '2013-06-01T00:00:00Z', name: alone, duration: 10.0, period: 0.1}
    graph: {nodes: [testbed/source, testbed/estimator]}
estimator:
  ros__parameters: {use_gyro: false}
"""
T0 = 1_370_044_800_000_000_000
STEP = 100_000_000


def estimator() -> type[Component]:
    """The component under test."""
    return find_component("testbed", "estimator")


def voltages(step: float, value: float = 1.0, frame: str = "bus", count: int = 2):
    """A message of voltages of a step."""
    codec = codec_of(CssVoltages)
    return codec.sample(T0 + round(step * STEP), frame, voltages=np.full(count, value))


class Rig:
    """One estimator, fed and heard."""

    def __init__(self, bench: Bench, mission, *overrides: str, text: str = ALONE) -> None:
        self.bench = bench
        self.estimates = bench.listen("estimator/sun_estimate", SunEstimate)
        self.node = bench.host(estimator(), mission(*overrides, text=text), "estimator")

    def feed(self, *samples) -> None:
        """Publishes voltages one by one: a subscription holds ten, like those of a real flight."""
        for sample in samples:
            edge = self.node.edges["voltages"]
            seen = edge.accepted + edge.rejected.total()
            self.bench.publish("voltages", CssVoltages, sample)
            self.bench.until(lambda: edge.accepted + edge.rejected.total() > seen, "the message has arrived")  # noqa: B023

    def until_estimates(self, count: int) -> None:
        """Waits for a number of estimates in all."""
        self.bench.until(lambda: len(self.estimates) >= count, f"{count} estimates")
        assert len(self.estimates) == count

    def until_counted(self, counter: str, count: int) -> None:
        """Waits until something was counted."""
        self.bench.until(lambda: self.node.health()[2].get(counter, 0) >= count, f"{counter} is {count}")
        assert self.node.health()[2][counter] == count

    def set_parameter(self, name: str, value):
        """The answer of the parameter service."""
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        (result,) = self.bench.request(SetParameters, "estimator/set_parameters", request).results
        return result


@pytest.fixture
def rig(bench, mission) -> Rig:
    """An estimator that listens to voltages alone."""
    return Rig(bench, mission)


def test_each_message_gives_one_estimate_of_its_stamp_and_frame(rig):
    rig.feed(*[voltages(k, value=0.5 * k) for k in range(5)])
    rig.until_estimates(5)
    assert [e.stamp_ns for e in rig.estimates] == [T0 + k * STEP for k in range(5)]
    assert [e.age for e in rig.estimates] == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert {e.frame_id for e in rig.estimates} == {"bus"}
    assert rig.node.health() == (
        DiagnosticStatus.OK,
        "active",
        {"cycles": 5, "voltages.accepted": 5, "unmatched": 0, "time_set_back": 0},
        T0 + 4 * STEP,
        (),
    )


def test_bad_messages_are_counted_reported_once_and_do_not_stop_the_node(rig, bench):
    codec = codec_of(CssVoltages)
    whole = codec.encode(voltages(1))
    rig.feed(voltages(0))
    rig.feed(voltages(1, count=3), voltages(1, count=3), voltages(1, frame="body"), voltages(1, value=np.nan))
    rig.feed(voltages(0), voltages(-1), whole[:-8] + b"\xff\xff\xff\xff\xff\xff\xff\x7f")
    rig.feed(voltages(2))
    rig.until_estimates(2)
    counters = rig.node.health()[2]
    assert {k: v for k, v in counters.items() if "rejected" in k} == {
        "voltages.rejected.wrong_length": 2,
        "voltages.rejected.wrong_frame": 1,
        "voltages.rejected.not_finite": 2,
        "voltages.rejected.stamp_repeated": 1,
        "voltages.rejected.stamp_back": 1,
    }
    assert rig.node.health()[:2] == (DiagnosticStatus.WARN, "messages rejected")
    bench.until(lambda: bench.logged("stamp_back"), "the last kind is logged")
    for kind in ("wrong_length", "wrong_frame", "not_finite", "stamp_repeated", "stamp_back"):
        assert bench.logged(f"voltages: {kind}: ") == 1


FAULTS = {
    "raise": "ZeroDivisionError: on demand",
    "nothing": "has no attribute 'items'",
    "unknown_output": "KeyError: 'guess'",
    "missing_field": "KeyError: 'age'",
    "wrong_length": "sun_b: 4 values given, the type has 3",
}


@pytest.mark.parametrize("fault", FAULTS)
def test_cycle_that_fails_in_any_way_is_counted_logged_once_and_survived(rig, bench, fault):
    rig.feed(voltages(0))
    rig.until_estimates(1)
    assert rig.set_parameter("fault", fault).successful
    rig.feed(*[voltages(1 + k) for k in range(3)])
    rig.until_counted("cycle_failed", 3)
    assert rig.node.health()[0] == DiagnosticStatus.ERROR
    bench.until(lambda: bench.logged(FAULTS[fault]), "the traceback is logged")
    assert rig.set_parameter("fault", "none").successful
    rig.feed(voltages(4))
    rig.until_estimates(5)
    # nobody has to wait for what does not come
    assert [e.frame_id for e in rig.estimates] == ["bus", GAP, GAP, GAP, "bus"]
    assert [e.stamp_ns for e in rig.estimates] == [T0 + k * STEP for k in range(5)]
    assert bench.logged(FAULTS[fault]) == 1
    assert rig.node.counters["cycles"] == 2


def test_estimate_with_nan_is_withheld_counted_and_logged_once(rig, bench):
    rig.set_parameter("fault", "nan")
    rig.feed(*[voltages(k) for k in range(3)])
    rig.until_counted("withheld_not_finite", 3)
    rig.set_parameter("fault", "none")
    rig.feed(voltages(3))
    rig.until_estimates(1)
    assert rig.estimates[0].stamp_ns == T0 + 3 * STEP
    bench.until(lambda: bench.logged("sun_b is not finite, message withheld"), "it is logged")
    assert bench.logged("withheld") == 1
    assert rig.node.health()[0] == DiagnosticStatus.ERROR


def test_what_a_component_reports_is_logged_by_its_node(rig, bench):
    rig.node.component.report("the Sun is up")
    bench.until(lambda: bench.logged("the Sun is up") == 1, "the line is in the log")


def test_time_set_back_begins_anew(rig):
    rig.feed(*[voltages(1000 + k) for k in range(3)])
    rig.until_estimates(3)
    rig.feed(*[voltages(k) for k in range(15)])
    rig.until_counted("time_set_back", 1)
    rig.bench.until(lambda: rig.estimates[-1].stamp_ns == T0 + 14 * STEP, "the newest step is estimated")
    again = [e for e in rig.estimates if e.stamp_ns < T0 + 1000 * STEP]
    assert [e.nis for e in again] == [1.0 + k for k in range(len(again))], "it counts its cycles from one again"


def test_late_joiner_receives_the_last_estimates(rig, bench):
    rig.feed(*[voltages(k) for k in range(3)])
    rig.until_estimates(3)
    late = bench.listen("estimator/sun_estimate", SunEstimate)
    bench.until(lambda: len(late) == 3, "the late joiner has the history")
    assert [e.stamp_ns for e in late] == [e.stamp_ns for e in rig.estimates]


def test_restarted_node_receives_the_stamp_that_waits_for_it(rig, bench, mission):
    rig.feed(voltages(0), voltages(1))
    rig.until_estimates(2)
    bench.remove(rig.node)
    bench.publish("voltages", CssVoltages, voltages(2), listened_to=False)
    bench.host(estimator(), mission(text=ALONE), "estimator")
    bench.until(lambda: rig.estimates[-1].stamp_ns == T0 + 2 * STEP, "the waiting stamp is answered")


def test_diagnostics_tell_level_and_counters(rig, bench):
    arrays: list[DiagnosticArray] = []
    bench.node.create_subscription(DiagnosticArray, "/diagnostics", arrays.append, 10)
    rig.feed(voltages(0), voltages(0), voltages(1))
    rig.until_estimates(2)

    def told() -> bool:
        return any(value.key == "cycles" and value.value == "2" for a in arrays for value in a.status[0].values)

    bench.until(told, "two cycles are told")
    status = arrays[-1].status[0]
    values = {value.key: value.value for value in status.values}
    assert status.name == "/estimator"
    assert (status.level, status.message) == (DiagnosticStatus.WARN, "messages rejected")
    assert values["voltages.accepted"] == "2"
    assert values["voltages.rejected.stamp_repeated"] == "1"
    assert arrays[-1].header.stamp.sec * 10**9 + arrays[-1].header.stamp.nanosec == T0 + STEP


GYRO = ALONE.replace("testbed/source,", "testbed/source, testbed/gyro,").replace("use_gyro: false", "use_gyro: true")


def imu(step: int):
    """A rate of a step."""
    return codec_of(Imu).sample(T0 + step * STEP, "bus")


def test_inputs_are_matched_by_stamp(bench, mission):
    rig = Rig(bench, mission, text=GYRO)
    rig.feed(voltages(0), voltages(1))
    bench.publish("gyro/imu", Imu, imu(0))
    bench.publish("gyro/imu", Imu, imu(1))
    rig.until_estimates(2)
    assert [e.nis_dof for e in rig.estimates] == [2, 2]


def test_in_real_time_a_silent_optional_input_delays_one_cycle_only(bench, mission):
    rig = Rig(bench, mission, "lockstep.realtime_factor=1", "io.deadline=0.05", text=GYRO)
    rig.feed(voltages(0))
    rig.until_estimates(1)
    assert rig.node.counters["deadline_missed"] == 1
    rig.feed(*[voltages(k) for k in range(1, 6)])
    rig.until_estimates(6)
    assert rig.node.counters["deadline_missed"] == 1
    assert {e.nis_dof for e in rig.estimates} == {1}
    bench.publish("gyro/imu", Imu, imu(5))
    rig.until_counted("unmatched", 1)
    bench.publish("gyro/imu", Imu, imu(6))
    rig.feed(voltages(6))
    rig.until_estimates(7)
    assert rig.estimates[-1].nis_dof == 2


EVENTS = ALONE.replace(
    "    graph:",
    """\
    events:
      more: {time: 0.2, node: estimator, action: set, parameter: gain, value: 3.0}
      rows: {time: 0.3, node: estimator, action: set, parameter: weights, value: [3.0, 4.0]}
      off: {time: 0.5, node: estimator, action: deactivate}
      on: {time: 0.7, node: estimator, action: activate}
      clash: {time: 0.8, node: estimator, action: set, parameter: floor, value: 5.0}
    graph:""",
)


def test_scripted_events_go_by_simulated_time(bench, mission):
    rig = Rig(bench, mission, text=EVENTS)
    rig.feed(*[voltages(k) for k in range(10)])
    rig.until_estimates(8)
    assert [(e.stamp_ns - T0) // STEP for e in rig.estimates] == [0, 1, 2, 3, 4, 7, 8, 9]
    assert [e.age for e in rig.estimates] == [1.0, 1.0] + [3.0] * 6
    assert [e.nis for e in rig.estimates] == [1, 2, 3, 4, 5, 1, 2, 3], "activated again, it begins anew"
    assert rig.node.component.values.weights.tolist() == [3.0, 4.0]
    # allowed by itself, but not with the gain in force by then
    assert rig.node.counters["events_refused"] == 1
    bench.until(lambda: bench.logged("event clash: floor: 5.0 given, expected at most the gain of 3.0"), "it is logged")


def test_empty_messages_of_the_rehearsal_reach_no_topic_and_no_state(rig):
    assert rig.node.component.count == 0
    assert rig.estimates == []
    assert default_values(estimator().table()).gain == 1.0
