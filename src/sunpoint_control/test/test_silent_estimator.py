# SPDX-License-Identifier: Apache-2.0
"""In real time an estimator falls silent: the control commands zero, says so, and goes on when it is back."""

import numpy as np

from css_common.codec import Sample, codec_of
from css_common.mission import load_mission
from css_common.testing import Bench
from css_msgs.msg import ControlStatus, SunEstimate, WheelState, WheelTorqueCommand
from sunpoint_control.nodes.mrp_control import MrpControl


class Rig:
    """A control in real time, fed with what it listens to."""

    def __init__(self, bench, *changes):
        self.bench, mission = bench, load_mission("okeefe_2013", [*changes])
        self.period_ns, self.epoch_ns = mission.period_ns, mission.epoch_ns
        self.torques = bench.listen("wheels/torque_command", WheelTorqueCommand)
        self.statuses = bench.listen("control/status", ControlStatus)
        self.node = bench.host(MrpControl, mission, "mrp_control")

    def feed(self, step, estimate=True):
        """Speeds of a stamp, and its estimate unless there is none."""
        stamp_ns = self.epoch_ns + step * self.period_ns
        wheels = codec_of(WheelState).sample(stamp_ns, "bus", speed=np.zeros(4), torque=np.zeros(4))
        self._send("wheels/state", WheelState, "wheels", wheels)
        if estimate:
            sun = codec_of(SunEstimate).sample(
                stamp_ns,
                "bus",
                sun_b=np.array([1.0, 0.0, 0.0]),
                validity=SunEstimate.VALIDITY_VALID,
                rate_source=SunEstimate.RATE_GYRO,
            )
            self._send("ekf/sun_estimate", SunEstimate, "sun", sun)

    def _send(self, topic: str, kind: type, key: str, sample: Sample) -> None:
        edge = self.node.edges[key]
        seen = edge.accepted
        self.bench.publish(topic, kind, sample)
        self.bench.until(lambda: edge.accepted > seen, "the message has arrived")

    def until(self, commands):
        """Waits for so many commands, each with its status."""
        self.bench.until(lambda: min(len(self.torques), len(self.statuses)) >= commands, f"{commands} commands")
        assert len(self.torques) == len(self.statuses) == commands


def test_a_silent_estimator_is_outlived_and_taken_back():
    with Bench() as bench:
        rig = Rig(bench, "lockstep.realtime_factor=1.0")
        rig.feed(0)
        rig.until(1)
        assert np.any(rig.torques[0].torque)
        rig.feed(1, estimate=False)
        rig.until(2)  # when the deadline is over
        assert not np.any(rig.torques[1].torque)
        for step in range(2, 5):
            rig.feed(step, estimate=False)
            rig.until(step + 1)  # not waited for again
            assert not np.any(rig.torques[step].torque)
        assert (rig.statuses[-1].mode, rig.statuses[-1].reason) == (
            ControlStatus.MODE_SAFE,
            ControlStatus.REASON_STALE_INPUT,
        )
        for step in range(5, 9):
            rig.feed(step)
            rig.until(step + 1)
        assert rig.statuses[-1].mode == ControlStatus.MODE_SUN_ACQUISITION
        assert np.any(rig.torques[-1].torque)


def test_devices_with_own_clocks_too():
    with Bench() as bench:
        rig = Rig(bench, "io.input_matching=latest", "io.deadline=0.3")
        rig.feed(0)
        rig.until(1)
        for step in range(1, 4):  # the last estimate is not too old yet, and the next may come
            rig.feed(step, estimate=False)
        for step in range(4, 7):
            rig.feed(step, estimate=False)
            rig.until(step - 2)
            assert not np.any(rig.torques[-1].torque)
        assert rig.statuses[-1].reason == ControlStatus.REASON_STALE_INPUT


def test_in_lockstep_time_waits_for_the_estimate():
    with Bench() as bench:
        rig = Rig(bench)
        rig.feed(0)
        rig.until(1)
        rig.feed(1, estimate=False)
        # nobody asks what is overdue
        assert rig.node._deadline_timer is None
        assert rig.node.matcher.oldest_pending() == rig.epoch_ns + rig.period_ns and len(rig.torques) == 1
