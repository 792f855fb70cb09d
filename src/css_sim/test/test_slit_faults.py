# SPDX-License-Identifier: Apache-2.0
"""Faults of slit heads: pulses that are missing, doubled, late or without a Sun, and what they leave alone."""

import numpy as np
import pytest
from scipy import stats

from css_common.codec import codec_of
from css_common.mission import load_mission
from css_common.random_streams import random_key
from css_monte_carlo.direct_flight import fly_and_keep
from css_msgs.msg import SlitPulses
from css_sim import faults, slit_faults
from css_sim.fault_kinds import kinds_of
from css_sim.slit_faults import Cycle, FaultyHeads, Pulse

PERIOD = 0.1
FREQUENCY = 1e6
COUNTS = 100_000  # of a cycle
SIGNIFICANCE = 1e-4
KEY = random_key(3, 1)
UNITS = {"head": ["0", "1"]}


def heads(*lines, key=KEY):
    failing = faults.of_case(kinds_of("head"), UNITS, key, PERIOD).of(list(lines))
    return FaultyHeads(failing, key, FREQUENCY)


def crossings(step, each=10):
    """As many pulses of both heads in a cycle, evenly."""
    return [Pulse(step * COUNTS + i * COUNTS // each, i % 3, head) for i in range(each) for head in (0, 1)]


def flown(*lines, steps=300, each=10):
    """Pulses of the cycles that healthy heads give, and those that come."""
    sensor = heads(*lines)
    given = [crossings(step, each) for step in range(steps)]
    come = [sensor.pulses(Cycle(step, step * COUNTS, (step + 1) * COUNTS), p) for step, p in enumerate(given)]
    return given, come


def all_of(cycles):
    return [pulse for pulses in cycles for pulse in pulses]


def test_a_dead_head_is_silent_from_its_time_to_its_end_and_the_other_is_not():
    given, come = flown("head.1 dead from 1 to 2", steps=30)
    for step in range(30):
        expected = [p for p in given[step] if p.head == 0 or not 10 <= step < 20]
        assert come[step] == sorted(expected)


def test_a_share_of_pulses_is_dropped():
    given, come = flown("head.0 dropped 0.3")
    lost = {*all_of(given)} - {*all_of(come)}
    assert {p.head for p in lost} == {0}
    assert stats.binomtest(len(lost), 3000, 0.3).pvalue > SIGNIFICANCE


def test_a_share_of_pulses_comes_again_later():
    given, come = flown("head.0 doubled 0.4 250")
    healthy = {*all_of(given)}
    extra = [p for p in all_of(come) if p not in healthy]
    assert all(p.head == 0 and p._replace(ticks=p.ticks - 250) in healthy for p in extra)
    assert stats.binomtest(len(extra), 3000, 0.4).pvalue > SIGNIFICANCE


@pytest.mark.parametrize("delay_us", [250, 7000, 130_000])
def test_late_pulses_come_in_the_cycle_of_their_time(delay_us):
    given, come = flown(f"head.1 late {delay_us} from 1 to 2", steps=30)
    shifted = [
        p._replace(ticks=p.ticks + (delay_us if p.head == 1 and 10 <= step < 20 else 0))
        for step, pulses in enumerate(given)
        for p in pulses
    ]
    assert come == [sorted(p for p in shifted if p.ticks // COUNTS == step) for step in range(30)]


def test_spurious_pulses_are_a_poisson_process_from_any_slit():
    _, come = flown("head.1 spurious 20", steps=3000, each=1)
    extra = [[p for p in pulses if p not in crossings(step, 1)] for step, pulses in enumerate(come)]
    counts = np.array([len(pulses) for pulses in extra])
    expected = stats.poisson(2.0).pmf(np.arange(7)) * 3000
    found = np.bincount(np.minimum(counts, 7), minlength=8)
    assert stats.chisquare(found, [*expected, 3000 - expected.sum()]).pvalue > SIGNIFICANCE
    pulses = all_of(extra)
    assert {p.head for p in pulses} == {1}
    within = np.array([p.ticks % COUNTS for p in pulses]) / COUNTS
    assert stats.kstest(within, "uniform").pvalue > SIGNIFICANCE
    assert stats.chisquare(np.bincount([p.slit for p in pulses], minlength=3)).pvalue > SIGNIFICANCE


def test_faults_have_draws_of_their_own():
    _, one = flown("head.0 dropped 0.5")
    _, both = flown("head.0 dropped 0.5", "head.0 dropped 0.5")
    left = sum(p.head == 0 for p in all_of(both))
    assert stats.binomtest(left, 3000, 0.25).pvalue > SIGNIFICANCE
    assert one == flown("head.0 dropped 0.5")[1]


def mission(*lines):
    given = ",".join(lines)
    return load_mission("esprit_2006", ["mission.duration=20", *([f"slit_sensor.faults={given}"] if given else [])])


def test_the_node_says_what_comes_and_tells_the_fault():
    plain = fly_and_keep(mission(), ["slits/step", "slits/pulse"])
    lines = "head.0 dead from 5 to 10", "head.0 late 2000 from 12"
    topics = ["slits/step", "slits/pulse", "faults/slit_sensor"]
    steps, pulses, told = fly_and_keep(mission(*lines), topics).values()
    epoch_ns = mission().epoch_ns
    counts, expected = (
        {round((s.stamp_ns - epoch_ns) / 1e9, 6): s.count.tolist() for s in of} for of in (steps, plain["slits/step"])
    )
    assert any(expected[t] for t in expected if 5 <= t < 10)
    for t in counts:
        if t < 5 or 10 <= t < 12:
            assert counts[t] == expected[t]
        elif t < 10:
            assert counts[t] == []
    late = sorted(c for t in counts if t >= 12 for c in counts[t])
    was = sorted(c for t in expected if t >= 12 for c in expected[t])
    assert len(was) - len(late) <= 1 and late == [c + 2000 for c in was[: len(late)]]
    assert len(pulses) == sum(map(len, counts.values()))
    assert [message.kind.tolist() for message in told] == [[0], [], [slit_faults.LATE]]
    encode = codec_of(SlitPulses).encode
    still = fly_and_keep(mission("head.0 dead from 100"), ["slits/step"])["slits/step"]
    assert [encode(s) for s in still] == [encode(s) for s in plain["slits/step"]]
