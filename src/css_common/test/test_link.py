# SPDX-License-Identifier: Apache-2.0
"""What becomes of messages on their way: what comes, in which order, and what says that something does not."""

from collections import Counter

import numpy as np
import pytest
from scipy import stats
from sensor_msgs.msg import Imu

from css_common import link_kinds
from css_common.component import Component, Output
from css_common.link import GAP, is_gap
from css_common.schema import default_values, shaped_values
from css_common.stepping import Stepper
from css_msgs.msg import WheelState

PERIOD_NS = 10**8
SIGNIFICANCE = 1e-4


class Sender(Component):
    """Sends the number of the cycle on two topics."""

    @classmethod
    def outputs(cls, name, values):
        return (Output("imu", "imu", Imu), Output("wheels", "wheels/state", WheelState), Output("truth", "truth", Imu))

    def cycle(self, stamp_ns, received):
        rate = np.full(3, float(self.step_of(stamp_ns)))
        speed = np.array([rate[0] + 0.5])
        none = {"orientation": np.zeros(4), "linear_acceleration": np.zeros(3)}
        none |= {f"{key}_covariance": np.zeros(9) for key in ("orientation", "angular_velocity", "linear_acceleration")}
        return {
            "imu": self.message("imu", stamp_ns, angular_velocity=rate, **none),
            "wheels": self.message("wheels", stamp_ns, speed=speed, torque=speed, speed_limited=0, torque_limited=0),
        }


def stepper(*lines, case=0):
    values = {p.name: p.default for p in Sender.table()} | {"io.faults": list(lines), "mission.case": case}
    values |= {"mission.epoch": "2026-06-01T00:00:00Z", "mission.duration": 1000.0}
    return Stepper(Sender, "sender", values)


def sent(*lines, steps=20, case=0):
    """What comes of each step on the topic imu: pairs of stamp in cycles and number, a gap as None."""
    steps_ = stepper(*lines, case=case)
    epoch_ns = steps_.component.epoch_ns
    come = []
    for step in range(steps):
        stamp_ns = epoch_ns + step * PERIOD_NS
        messages = steps_.sent(stamp_ns, steps_.step(stamp_ns, {}))
        come.append(
            [
                ((s.stamp_ns - epoch_ns) / PERIOD_NS, None if s.frame_id == GAP else float(s.angular_velocity[0]))
                for port, s, data in messages
                if port.topic == "imu" and is_gap(data) == (s.frame_id == GAP)
            ]
        )
    return come


def as_sent(step):
    return [(step, float(step))]


def test_without_faults_messages_pass_as_they_are():
    assert sent() == [as_sent(step) for step in range(20)]


def test_what_is_dropped_leaves_a_gap_and_other_topics_pass():
    come = sent("message.imu dropped 1 from 0.5 to 0.8", "message.wheels/state dropped 1")
    assert come == [[(step, None)] if 5 <= step < 8 else as_sent(step) for step in range(20)]


def test_a_late_message_comes_before_the_one_of_its_cycle():
    come = sent("message.imu late 3 from 0.5 to 0.7", steps=12)
    assert come[5:7] == [[(5, None)], [(6, None)]]
    assert come[8:10] == [[(5, 5.0), (8, 8.0)], [(6, 6.0), (9, 9.0)]]
    assert come[7] == as_sent(7) and come[10] == as_sent(10)


def test_a_doubled_message_comes_twice():
    assert sent("message.imu doubled 1 from 0.5 to 0.6", steps=7)[4:] == [as_sent(4), as_sent(5) * 2, as_sent(6)]


def test_a_reordered_message_comes_after_the_next_one():
    come = sent("message.imu reordered 1 from 0.5 to 0.6", steps=8)
    assert come[4:8] == [as_sent(4), [(5, None)], [(6, 6.0), (5, 5.0)], as_sent(7)]


def test_a_clock_that_is_off_stamps_all_and_says_what_does_not_come():
    come = sent("clock.sender step 0.7 from 0.5 to 0.7", steps=9)
    assert come[4] == as_sent(4)
    assert come[5:7] == [[(12, 5.0), (5, None)], [(13, 6.0), (6, None)]]
    assert come[7] == [(7, 7.0), (7, None)]  # right again, but not yet believed
    assert sent("clock.sender step -0.7 from 0.5 to 0.7", steps=6)[5][0] == (-2, 5.0)


@pytest.mark.parametrize("kind", ["dropped", "doubled", "reordered", "corrupted"])
def test_a_share_is_the_probability_of_each_message_independent_of_the_last_one(kind):
    come = sent(f"message.imu {kind} 0.3", steps=3000)
    hit = np.array(
        [
            {
                "dropped": messages == [(step, None)],
                "doubled": len(messages) == 2,
                "reordered": (step, None) in messages,
                "corrupted": len(messages) == 2,
            }[kind]
            for step, messages in enumerate(come)
        ]
    )
    assert stats.binomtest(int(hit.sum()), len(hit), 0.3).pvalue > SIGNIFICANCE
    table = np.histogram2d(hit[:-1], hit[1:], bins=2)[0]
    assert stats.chi2_contingency(table).pvalue > SIGNIFICANCE


def test_a_corrupted_message_differs_in_one_bit_of_one_number_each_equally_likely():
    flipped: Counter[int] = Counter()
    steps_ = stepper("message.imu corrupted 1")
    clean = stepper()
    for step in range(4000):
        stamp_ns = steps_.component.epoch_ns + step * PERIOD_NS
        (port, _, data), _gap = (m for m in steps_.sent(stamp_ns, steps_.step(stamp_ns, {})) if m[0].topic == "imu")
        (_, _, whole), *_ = clean.sent(stamp_ns, clean.step(stamp_ns, {}))
        bits = np.unpackbits(np.frombuffer(data, np.uint8) ^ np.frombuffer(whole, np.uint8))
        (place,) = np.flatnonzero(bits)
        flipped[int(place)] += 1
        size = sum(np.size(getattr(port.codec.sample(0, "bus"), f.name)) for f in port.real_fields)
    assert size == 37
    counts = np.array([*flipped.values(), *[0] * (64 * size - len(flipped))])
    assert stats.chisquare(counts).pvalue > SIGNIFICANCE


def test_cases_and_faults_have_draws_of_their_own():
    line = "message.imu dropped 0.5"
    one, other = sent(line, steps=200), sent(line, steps=200, case=1)
    assert one == sent(line, steps=200) != other
    both = sent(line, line, steps=2000)
    hit = sum(messages != as_sent(step) for step, messages in enumerate(both))
    assert stats.binomtest(hit, 2000, 0.75).pvalue > SIGNIFICANCE


def test_the_truth_is_no_message_and_a_plant_has_no_clock_of_its_own():
    values = shaped_values(Sender.table(), {p.name: p.default for p in Sender.table()})
    assert Sender.link_units("sender", values) == {
        "message": ["imu", "wheels/state"], "clock": ("sender",), "process": ("sender",)
    }  # fmt: skip
    assert "clock" not in link_kinds.units("dynamics", Sender.outputs("x", values), owns_time=True)


def test_what_acts_is_told_when_it_changes():
    steps_ = stepper("message.imu dropped 0.5 from 0.2 to 0.4", "process.sender killed from 0.3")
    told = {}
    for step in range(8):
        stamp_ns = steps_.component.epoch_ns + step * PERIOD_NS
        for port, sample, _ in steps_.sent(stamp_ns, steps_.step(stamp_ns, {})):
            if port.topic == "faults/sender/link":
                told[step] = [*zip(sample.sort.tolist(), sample.kind.tolist(), strict=True)]
    dropped = (link_kinds.MESSAGE, link_kinds.DROPPED)
    assert told == {2: [dropped], 3: [dropped, (link_kinds.PROCESS, link_kinds.KILLED)], 4: []}


def test_a_snapshot_has_the_messages_that_are_on_their_way():
    steps_ = stepper("message.imu late 2 from 0.1 to 0.3")
    epoch_ns = steps_.component.epoch_ns

    def step(k):
        stamp_ns = epoch_ns + k * PERIOD_NS
        return [data for _, _, data in steps_.sent(stamp_ns, steps_.step(stamp_ns, {}))]

    for k in range(3):
        step(k)
    snapshot = steps_.snapshot()
    first = [step(k) for k in range(3, 6)]
    steps_.restore(snapshot)
    assert [step(k) for k in range(3, 6)] == first


def test_default_values_have_no_faults():
    assert default_values(Sender.table())[link_kinds.LINK_FAULTS] == []
    assert stepper().link.is_quiet
