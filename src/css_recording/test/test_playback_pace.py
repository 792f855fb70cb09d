# SPDX-License-Identifier: Apache-2.0
"""When stamps are due, by a wall clock that the test moves."""

import math
from types import SimpleNamespace

import pytest

from css_recording.playback_pace import PlaybackPace

SECOND = 1_000_000_000
START = 1_363_000_000 * SECOND


@pytest.fixture
def wall():
    return SimpleNamespace(now=100.0)


def pace_of(wall, rate, **options):
    pace = PlaybackPace(rate, lambda: wall.now, **options)
    pace.start(START)
    return pace


def test_a_stamp_is_due_after_its_time_over_the_rate(wall):
    pace = pace_of(wall, 4.0)
    assert pace.wait(START) == 0.0
    assert pace.wait(START + 2 * SECOND) == pytest.approx(0.5)
    wall.now += 0.3
    assert pace.wait(START + 2 * SECOND) == pytest.approx(0.2)
    wall.now += 5.0
    assert pace.wait(START + 2 * SECOND) == 0.0


def test_a_new_rate_holds_from_where_the_playback_is(wall):
    pace = pace_of(wall, 1.0)
    pace.wait(START + 10 * SECOND)
    wall.now += 4.0
    pace.rate = 3.0
    assert pace.wait(START + 10 * SECOND) == pytest.approx(6.0 / 3.0)
    pace.rate = math.inf
    assert pace.wait(START + 10 * SECOND) == 0.0
    pace.wait(START + 20 * SECOND)
    pace.rate = 0.5
    # as fast as it went, it had got to the stamp that it waited for
    assert pace.wait(START + 20 * SECOND) == 0.0
    assert pace.wait(START + 21 * SECOND) == pytest.approx(2.0)


def test_held_nothing_is_due_and_afterwards_it_goes_on_from_there(wall):
    pace = pace_of(wall, 2.0)
    pace.wait(START + 8 * SECOND)
    wall.now += 1.0
    pace.pause()
    assert pace.paused
    assert pace.wait(START + 8 * SECOND) == math.inf
    wall.now += 1000.0
    pace.resume()
    assert not pace.paused
    assert pace.wait(START + 8 * SECOND) == pytest.approx((8.0 - 2.0) / 2.0)


def test_a_late_playback_does_not_hurry_after_it_was_held(wall):
    pace = pace_of(wall, 1.0)
    pace.wait(START + SECOND)
    wall.now += 60.0  # the machine was busy
    pace.pause()
    pace.resume()
    assert pace.wait(START + SECOND) == 0.0
    assert pace.wait(START + 2 * SECOND) == pytest.approx(1.0)


def test_a_granted_message_is_due_once_and_the_position_moves_with_it(wall):
    pace = pace_of(wall, 1.0, paused=True)
    first, second = START + SECOND, START + 3 * SECOND
    assert pace.wait(first) == math.inf
    pace.grant_message()
    assert pace.wait(first) == 0.0
    pace.played(first)
    assert pace.wait(second) == math.inf
    pace.resume()
    assert pace.wait(second) == pytest.approx(2.0)


def test_a_granted_stamp_is_due_until_it_is_over(wall):
    pace = pace_of(wall, 1.0, paused=True)
    pace.grant_stamp()
    for _ in range(3):
        assert pace.wait(START) == 0.0
        pace.played(START)
    pace.stamp_is_over()
    assert pace.wait(START + SECOND) == math.inf


def test_grants_do_not_outlast_the_hold(wall):
    pace = pace_of(wall, 1.0, paused=True)
    pace.grant_message()
    pace.grant_stamp()
    pace.resume()
    pace.pause()
    assert pace.wait(START + SECOND) == math.inf
