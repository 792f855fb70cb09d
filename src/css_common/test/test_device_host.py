# SPDX-License-Identifier: Apache-2.0
"""Devices in their nodes: a thread reads, the node publishes, and neither harms the other."""

import math
import time
from typing import Any, cast

import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from css_common.device import Reading
from css_common.mission import find_component
from css_msgs.msg import CssVoltages

ALONE = """\
/**:
  ros__parameters:
    mission: {name: alone}
    graph: {nodes: [testbed/probe]}
"""


class Rig:
    """A device in its node."""

    def __init__(self, bench, mission):
        self.bench = bench
        self.kind = cast(Any, find_component("testbed", "probe"))
        while not self.kind.told.empty():
            self.kind.told.get()
        self.kind.begun.clear()
        self.kind.noted.clear()
        self.heard = bench.listen("voltages", CssVoltages)
        self.node = bench.host(self.kind, mission(text=ALONE), "probe")

    def read(self, *values, stamp_ns=None):
        stamp_ns = time.time_ns() if stamp_ns is None else stamp_ns
        self.kind.told.put(Reading(stamp_ns, time.monotonic_ns(), list(values)))
        return stamp_ns


@pytest.fixture
def rig(bench, mission):
    return Rig(bench, mission)


def test_each_reading_is_a_message_of_its_stamp(rig, bench):
    stamps = [rig.read(float(k)) for k in range(20)]
    bench.until(lambda: len(rig.heard) == 20, "all readings")
    assert [m.stamp_ns for m in rig.heard] == stamps
    assert [m.voltages[0] for m in rig.heard] == list(range(20))
    assert [note.stamp_ns for note in rig.kind.noted] == stamps


def test_element_that_may_be_missing_is_published_as_nan(rig, bench):
    rig.read(1.0, math.nan)
    bench.until(lambda: rig.heard, "the reading")
    assert math.isnan(rig.heard[0].voltages[1])
    assert rig.node.counters["withheld_not_finite"] == 0


def test_thread_lives_while_the_node_is_active(rig, bench):
    rig.node.trigger_deactivate()
    assert rig.kind.begun == ["begin", "end"]
    rig.read(1.0)
    rig.node.trigger_activate()
    bench.until(lambda: rig.heard, "the reading after that")
    rig.node.trigger_deactivate()
    rig.node.trigger_cleanup()
    assert rig.kind.begun == ["begin", "end"] * 2


def test_cycle_that_fails_costs_its_reading_alone(rig, bench):
    rig.read("volts")
    rig.read(2.0)
    bench.until(lambda: rig.heard, "the next reading")
    assert rig.heard[0].voltages.tolist() == [2.0]
    assert rig.node.counters["cycle_failed"] == 1
    assert rig.node.health().level == DiagnosticStatus.ERROR


def test_device_that_raises_is_said_and_its_node_lives_on(rig, bench):
    rig.kind.told.put(ZeroDivisionError("on the bus"))
    bench.until(lambda: rig.node.counters["cycle_failed"] == 1, "it is counted")
    bench.until(lambda: bench.logged("ZeroDivisionError: on the bus"), "it is logged")
    rig.read(3.0)
    bench.until(lambda: rig.heard, "it has begun again by itself")
    assert rig.kind.begun == ["begin", "end", "begin"]


def test_node_that_does_not_come_to_its_readings_drops_and_counts(rig, bench):
    for k in range(200):
        rig.read(float(k))
    # the executor rests meanwhile: only the device's thread runs
    limit = time.monotonic() + 60.0
    while not rig.kind.told.empty() and time.monotonic() < limit:
        time.sleep(0.01)
    bench.until(lambda: rig.heard and rig.node.counters["readings_dropped"] > 0, "what was kept comes")
    bench.until(lambda: len(rig.heard) + rig.node.counters["readings_dropped"] >= 200, "all are accounted for")
    assert [m.voltages[0] for m in rig.heard] == list(range(len(rig.heard)))
