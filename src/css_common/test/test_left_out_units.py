# SPDX-License-Identifier: Apache-2.0
"""What a node holds for failed stands in its diagnostics, and is a warning while nothing worse is."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from css_common.codec import codec_of
from css_common.mission import find_component
from css_common.testing import Bench
from css_msgs.msg import CssVoltages

TEXT = """\
/**:
  ros__parameters:
    mission: {duration: 10.0, epoch: '2013-06-01T00:00:00Z'}
    graph: {nodes: [testbed/source, testbed/gyro, testbed/estimator]}
estimator:
  ros__parameters: {use_gyro: false}
"""
T0 = 1_370_044_800_000_000_000


@pytest.fixture
def node(bench: Bench, mission):
    return bench.host(find_component("testbed", "estimator"), mission(text=TEXT), "estimator")


def test_units_that_are_held_for_failed_are_a_warning_until_they_are_used_again(bench: Bench, node):
    reports: list[DiagnosticArray] = []
    bench.node.create_subscription(DiagnosticArray, "/diagnostics", reports.append, 10)

    def said(message: str) -> bool:
        return bool(reports) and reports[-1].status[0].message == message

    node.component.left_out = ("cell.1", "gyro.x")
    bench.until(lambda: said("held for failed: cell.1, gyro.x"), "the report says so")
    (status,) = reports[-1].status
    assert status.level == DiagnosticStatus.WARN
    assert {entry.key: entry.value for entry in status.values}["left_out"] == "cell.1, gyro.x"
    node.component.left_out = ()
    bench.until(lambda: said("active"), "it is well again")
    (status,) = reports[-1].status
    assert status.level == DiagnosticStatus.OK and "left_out" not in [entry.key for entry in status.values]


def test_what_is_worse_is_said_first_and_the_units_all_the_same(bench: Bench, node):
    node.component.left_out = ("cell.1",)
    message = codec_of(CssVoltages).sample(T0, "bus", voltages=np.ones(3))
    bench.publish("voltages", CssVoltages, message)
    bench.until(lambda: node.health().message == "messages rejected", "the message is rejected")
    assert node.health().left_out == ("cell.1",)
    node.trigger_deactivate()
    node.trigger_cleanup()
    assert node.health().left_out == ()
