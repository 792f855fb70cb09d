# SPDX-License-Identifier: Apache-2.0
"""Inputs that do not come: named where a node waits for them, not waited for while the values make nothing of them."""

from dataclasses import replace

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from sensor_msgs.msg import Imu
from testbed.nodes.estimator import Estimator

from css_common.codec import Sample, codec_of
from css_common.component import Input
from css_common.schema import Values, flag
from css_common.testing import Bench
from css_msgs.msg import CssVoltages, SunEstimate

TEXT = """\
/**:
  ros__parameters:
    mission: {epoch: '2013-06-01T00:00:00Z', name: unmet, duration: 10.0, period: 0.1}
    graph: {nodes: [testbed/source, testbed/gyro, testbed/estimator]}
"""
T0 = 1_370_044_800_000_000_000
STEP = 100_000_000


class Choosy(Estimator):
    """An estimator that may be told in flight to do without its gyro."""

    parameters = tuple(
        flag("use_gyro", True, "listen to the gyro", tunable=True) if p.name == "use_gyro" else p
        for p in Estimator.parameters
    )

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        """The gyro too while it is not used."""
        voltages, gyro = super().inputs(name, Values(use_gyro=True, use_field=False))
        return voltages, replace(gyro, heeded=values.use_gyro)


class Rig:
    """The estimator, fed and heard."""

    def __init__(self, bench: Bench, mission, *overrides: str) -> None:
        self.bench = bench
        self.estimates = bench.listen("estimator/sun_estimate", SunEstimate)
        self.node = bench.host(Choosy, mission(*overrides, text=TEXT), "estimator")

    def feed(self, key: str, step: int) -> None:
        """Publishes a message of one input and waits until the node has it."""
        kind: type = CssVoltages if key == "voltages" else Imu
        sample = codec_of(kind).sample(T0 + step * STEP, "bus")
        if key == "voltages":
            sample.voltages = np.ones(2)
        edge = self.node.edges[key]
        seen = edge.accepted + edge.rejected.total()
        self.bench.publish("voltages" if key == "voltages" else "gyro/imu", kind, sample)
        self.bench.until(lambda: edge.accepted + edge.rejected.total() > seen, "the message has arrived")

    def use_gyro(self, value: bool) -> None:
        """Sets the parameter as an operator does."""
        request = SetParameters.Request(parameters=[Parameter("use_gyro", value=value).to_parameter_msg()])
        assert self.bench.request(SetParameters, "estimator/set_parameters", request).results[0].successful

    def until_estimates(self, *heard: int) -> None:
        """Waits for estimates, of which so many inputs were heard in each."""
        self.bench.until(lambda: len(self.estimates) >= len(heard), f"{len(heard)} estimates")
        assert [e.nis_dof for e in self.estimates] == list(heard)


def test_a_gyro_that_is_not_used_is_neither_awaited_nor_handed_over(bench, mission):
    rig = Rig(bench, mission, "estimator.use_gyro=false")
    rig.feed("gyro", 0)
    rig.feed("voltages", 0)
    rig.feed("voltages", 1)
    rig.feed("gyro", 1)
    rig.until_estimates(1, 1)
    assert rig.node.health().counters["unmatched"] == 0
    assert rig.node.health().level == DiagnosticStatus.OK


def test_a_gyro_that_is_used_again_is_awaited_again(bench, mission):
    rig = Rig(bench, mission, "estimator.use_gyro=false")
    rig.feed("voltages", 0)
    rig.use_gyro(True)
    rig.feed("voltages", 1)
    rig.feed("gyro", 1)
    rig.until_estimates(1, 2)


def test_a_cycle_that_waits_for_a_broken_gyro_runs_when_it_is_not_to_be_used_any_more(bench, mission):
    rig = Rig(bench, mission)
    rig.feed("voltages", 0)
    assert rig.estimates == []
    rig.use_gyro(False)
    rig.until_estimates(1)
    rig.feed("voltages", 1)
    rig.until_estimates(1, 1)


def test_what_a_node_waits_for_is_warned_about_once_and_stands_in_its_diagnostics(bench, mission):
    rig = Rig(bench, mission)
    rig.feed("voltages", 0)
    rig.node.health()
    status = rig.node.health()
    assert status.level == DiagnosticStatus.WARN
    assert status.message == f"stamp {T0} ns waits for gyro/imu (not when parameter use_gyro is false)"
    bench.until(lambda: bench.logged("waits for gyro/imu") == 1, "it is logged")
    rig.feed("voltages", 1)
    rig.feed("gyro", 1)
    rig.until_estimates(2)
    status = rig.node.health()
    assert status.message.startswith(f"gyro/imu: missing in 1 cycles, which did not run, the first at stamp {T0} ns")
    assert "io.input_matching=latest" in status.message
    rig.feed("gyro", 0)
    assert rig.node.health().counters["unmatched"] == 1, "the stamp guard refuses what goes back"
    assert bench.logged("(what follows is in /diagnostics)") == 1


def test_samples_of_the_wrong_instant_are_told_from_missing_ones(bench, mission):
    rig = Rig(bench, mission)
    for key, step in (("voltages", 0), ("gyro", 0), ("voltages", 2), ("gyro", 2), ("voltages", 3)):
        rig.feed(key, step)
    rig.until_estimates(2, 2)
    late = Sample(T0 + STEP, "bus")
    assert rig.node.matcher.offer("gyro", late) == []
    (line,) = rig.node.matcher.complaints()
    told = "gyro/imu: 1 messages came when the cycle of their stamp was over, the first at stamp"
    assert line.startswith(f"{told} {T0 + STEP} ns")
