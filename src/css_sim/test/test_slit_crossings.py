# SPDX-License-Identifier: Apache-2.0
"""Slit crossings against closed forms and a search by other means; the timer behind them."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from spinning import FLIGHT, STEADY, motion_of, payload_values, sun_over_andoya

from css_common.random_streams import random_key
from css_msgs.msg import SlitPulse
from css_sensors.slits import LOWER, UPPER, VERTICAL
from css_sim.slit_crossings import slit_crossings, slit_geometry
from css_sim.slit_timer import SlitTimer, read_pulses
from css_sim.spinning_payload import payload_state

SUN_N = sun_over_andoya()
IDEAL = SlitTimer(1e6, 0.0, 0.0, 0.0, 3e-4)


def crossings(motion, geometry, start, end, room=4000):
    times, slits, heads = np.zeros(room), np.zeros(room, dtype=np.int64), np.zeros(room, dtype=np.int64)
    count = slit_crossings(motion, geometry, SUN_N, start, end, times, slits, heads)
    return times[:count], slits[:count], heads[:count]


def test_slits_are_numbered_as_in_the_message():
    assert (UPPER, VERTICAL, LOWER) == (SlitPulse.SLIT_UPPER, SlitPulse.SLIT_VERTICAL, SlitPulse.SLIT_LOWER)


@settings(max_examples=40, deadline=None)
@given(sun_angle=st.floats(-55.0, 55.0), spin=st.floats(0.5, 8.0), case=st.integers(0, 1000))
def test_a_fixed_axis_gives_the_intervals_of_the_paper(sun_angle, spin, case):
    """sin(arc/2) = tan SA / tan 60 (Eq. 4), the vertical slit half-way, the upper first for a Sun above."""
    motion = motion_of(case, payload__coning_angle_deg=[0.0], payload__spin_hz=[spin], payload__coning_period=[10.0])
    k = np.array(payload_state(motion, 0.0).dcm_bn)[2]
    across = np.cross(k, [0.3, 0.4, 0.5])
    across /= np.linalg.norm(across)
    sun_n = tuple((math.cos(math.radians(sun_angle)) * across + math.sin(math.radians(sun_angle)) * k).tolist())
    room = 64
    times, slits, heads = np.zeros(room), np.zeros(room, dtype=np.int64), np.zeros(room, dtype=np.int64)
    geometry = slit_geometry(payload_values())
    n = slit_crossings(motion, geometry, sun_n, 0.0, 4.0 / spin, times, slits, heads)
    upper, vertical, lower = (times[:n][slits[:n] == s] for s in (UPPER, VERTICAL, LOWER))
    np.testing.assert_allclose(np.diff(vertical), 1.0 / spin, rtol=1e-10)
    arc = 2.0 * math.asin(math.tan(math.radians(sun_angle)) / math.sqrt(3.0))
    for t in vertical:
        first, last = upper[np.argmin(abs(upper - t))], lower[np.argmin(abs(lower - t))]
        if 0.25 < t * spin < 3.75:  # no slit of the passage lies outside the interval
            assert (last - first) * 2.0 * math.pi * spin == pytest.approx(arc, abs=1e-9)
            assert 0.5 * (first + last) == pytest.approx(t, abs=1e-11)


def test_crossings_are_those_that_a_dense_search_finds():
    motion, geometry = motion_of(2, **FLIGHT), slit_geometry(payload_values())
    found = crossings(motion, geometry, 68.0, 71.0)
    expected = []
    for slit in (UPPER, VERTICAL, LOWER):

        def off(t, slit=slit):
            _, y, z = np.array(payload_state(motion, t).dcm_bn) @ SUN_N
            return y - (1 - slit) * math.tan(math.radians(30.0)) * z

        grid = np.linspace(68.0, 71.0, 6001)
        values = np.array([off(t) for t in grid])
        for i in np.flatnonzero(np.diff(np.sign(values))):
            t = brentq(off, grid[i], grid[i + 1], xtol=1e-14)
            if (np.array(payload_state(motion, t).dcm_bn) @ SUN_N)[0] > 0.0:
                expected.append((t, slit))
    expected.sort()
    assert len(found[0]) == len(expected) > 45
    np.testing.assert_allclose(found[0], [t for t, _ in expected], atol=2e-12)
    np.testing.assert_array_equal(found[1], [slit for _, slit in expected])


@pytest.mark.parametrize("step", [0.003, 0.01, 0.25])
def test_steps_of_any_length_give_the_same_crossings(step):
    motion = motion_of(5, **FLIGHT)
    geometry = slit_geometry(payload_values(slits__head_azimuths_deg=[0.0, 130.0]))
    whole = crossings(motion, geometry, 60.0, 64.0)
    edges = np.append(np.arange(60.0, 64.0 - 1e-9, step), 64.0)
    parts = [crossings(motion, geometry, a, b) for a, b in pairwise(edges)]
    np.testing.assert_allclose(np.concatenate([p[0] for p in parts]), whole[0], atol=1e-11)
    np.testing.assert_array_equal(np.concatenate([p[1] for p in parts]), whole[1])
    np.testing.assert_array_equal(np.concatenate([p[2] for p in parts]), whole[2])


def test_heads_see_the_same_sun_one_after_the_other():
    values = payload_values(slits__head_azimuths_deg=[0.0, 90.0, 180.0, 270.0])
    still = motion_of(**STEADY | {"payload__coning_angle_deg": [0.0]})
    times, slits, heads = crossings(still, slit_geometry(values), 0.0, 3.0)
    vertical = slits == VERTICAL
    np.testing.assert_allclose(np.diff(times[vertical]), 0.25 / 5.45, atol=1e-11)
    assert set(heads[vertical][:4]) == {0, 1, 2, 3}


def test_nothing_is_seen_beyond_the_field_of_view():
    motion = motion_of(**STEADY)
    narrow = slit_geometry(payload_values(slits__field_of_view_deg=20.0))
    assert len(crossings(motion, narrow, 0.0, 5.0)[0]) == 0  # the Sun stands near 23 deg


def pulses(timer, times, step=7):
    n = len(times)
    slits, heads = np.arange(n) % 3, np.zeros(n, dtype=np.int64)
    ticks, codes = np.zeros(2 * n, dtype=np.int64), np.zeros((2 * n, 2), dtype=np.int64)
    count = read_pulses(timer, random_key(3, 0), step, n, np.asarray(times), slits, heads, ticks, codes)
    return ticks[:count], codes[:count, 0]


def test_counts_are_whole_turns_of_the_timer():
    ticks, slits = pulses(IDEAL, [0.1234567, 0.2000009, 0.3])
    np.testing.assert_array_equal(ticks, [123456, 200000, 300000])
    np.testing.assert_array_equal(slits, [0, 1, 2])


def test_missed_and_double_pulses_have_their_probabilities_and_jitter_its_width():
    times = np.linspace(1.0, 41.0, 20001)[:-1]
    kept, _ = pulses(IDEAL._replace(missed=0.1), times)
    assert len(kept) / len(times) == pytest.approx(0.9, abs=4 * 0.0022)
    twice, _ = pulses(IDEAL._replace(double=0.05, double_delay=1e-5), times)
    assert len(twice) / len(times) == pytest.approx(1.05, abs=4 * 0.0016)
    late, _ = pulses(IDEAL._replace(jitter=5e-5), times)
    error = late * 1e-6 + 5e-7 - times
    assert np.std(error) == pytest.approx(5e-5, rel=0.03)
    assert abs(np.mean(error)) < 4 * 5e-5 / math.sqrt(len(times))
    assert np.all(np.diff(late) >= 0)
