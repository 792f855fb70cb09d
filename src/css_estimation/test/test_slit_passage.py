# SPDX-License-Identifier: Apache-2.0
"""Pulses gathered to passages: good ones pass unharmed, bad ones are refused for the right reason."""

import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from css_common.schema import default_values
from css_estimation.spin import slit_measurement
from css_estimation.spin.slit_passage import (
    REASON_COUNT,
    REASON_DOUBLE,
    REASON_MISSED,
    REASON_NO_TURN,
    REASON_ORDER,
    REASON_TIMER,
    REASON_TURN_CHANGE,
    REASON_TURN_RANGE,
)
from css_estimation.spin.slit_record import read_record
from css_sensors.slits import LOWER, SLITS, UPPER, VERTICAL

PARAMETERS = slit_measurement.parameters(default_values((*SLITS, *slit_measurement.PARAMETERS)))
TURN = 180_000
ANGLE = math.radians(23.0)
HALF = round(TURN * math.asin(math.tan(ANGLE) / math.sqrt(3.0)) / (2.0 * math.pi))


def passage(number, half=HALF, turn=TURN):
    middle = 1000 + number * turn
    return [(UPPER, middle - half), (VERTICAL, middle), (LOWER, middle + half)]


def read(pulses):
    ordered = sorted(pulses, key=lambda pulse: pulse[1])
    return read_record(PARAMETERS, [(slit, count % 2**32, 0) for slit, count in ordered], [0.0])


def steady(count=20):
    return [pulse for i in range(1, count + 1) for pulse in passage(i)]


def reasons(record):
    return {reason: count for reason, count in record.refused.items() if reason != REASON_NO_TURN}


def test_steady_turns_are_all_measured_from_the_second_on():
    record = read(steady())
    assert len(record.passages.time) == 19
    np.testing.assert_allclose(record.passages.angle, ANGLE, atol=2e-5)
    np.testing.assert_allclose(record.passages.rate, 2.0 * math.pi * 1e6 / TURN, rtol=1e-12)
    assert reasons(record) == {}


def test_measurements_go_on_while_the_timer_wraps():
    shifted = [(slit, count + 2**32 - 10 * TURN) for slit, count in steady()]
    record = read_record(PARAMETERS, [(slit, count % 2**32, 0) for slit, count in shifted], [0.0])
    assert len(record.passages.time) == 19
    np.testing.assert_allclose(np.diff(record.passages.time), TURN * 1e-6, atol=1e-9)


def test_a_second_pulse_is_refused_and_harms_nothing():
    record = read([*steady(), (UPPER, passage(7)[0][1] + 300)])
    assert len(record.passages.time) == 19
    assert reasons(record) == {REASON_DOUBLE: 1}


@pytest.mark.parametrize("slit", [UPPER, VERTICAL, LOWER])
def test_a_missing_pulse_costs_its_passage_alone_or_the_turn_that_begins_with_it(slit):
    pulses = steady()
    pulses.remove(passage(9)[slit])
    record = read(pulses)
    assert len(record.passages.time) == (17 if slit == UPPER else 18)
    assert record.refused[REASON_MISSED] == 1
    np.testing.assert_allclose(record.passages.angle, ANGLE, atol=2e-5)


def test_a_passage_that_is_missing_altogether_makes_a_turn_too_long():
    record = read([p for p in steady() if p not in passage(9)])
    assert len(record.passages.time) == 17
    assert reasons(record) == {REASON_TURN_CHANGE: 1}


def test_a_sun_that_was_away_for_long_is_not_a_turn():
    later = [(slit, count + 60 * TURN) for slit, count in steady(5)]
    record = read([*steady(5), *later])
    assert reasons(record) == {REASON_TURN_RANGE: 1}
    assert len(record.passages.time) == 4 + 4


def test_a_change_of_rate_is_believed_when_it_lasts():
    fast = [pulse for i in range(1, 6) for pulse in passage(i)]
    start = 1000 + 5 * TURN
    slow = [(slit, count - 1000 + start) for i in range(1, 11) for slit, count in passage(i, 40_000, 300_000)]
    record = read([*fast, *slow])
    assert reasons(record) == {REASON_TURN_CHANGE: 2}
    assert record.passages.rate[-1] == pytest.approx(2.0 * math.pi * 1e6 / 300_000)


def test_a_vertical_pulse_outside_of_the_slanted_ones_is_refused():
    pulses = steady()
    pulses[pulses.index(passage(9)[VERTICAL])] = (VERTICAL, passage(9)[LOWER][1] + 9000)
    assert reasons(read(pulses)) == {REASON_ORDER: 1}


def test_an_arc_of_more_than_half_a_turn_is_impossible():
    wide = [pulse for i in range(1, 21) for pulse in passage(i, half=46_000)]
    record = read(wide)
    assert reasons(record) == {REASON_COUNT: 19}
    assert len(record.passages.time) == 0


def test_a_timer_that_begins_anew_is_told_and_followed():
    again = [(slit, count, 0) for slit, count in steady()]
    record = read_record(PARAMETERS, [*again, *again], [0.0])
    assert record.refused[REASON_TIMER] == 1
    assert len(record.passages.time) == 2 * 19


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.integers(-2, 5), st.integers(0, 2**32 - 1), st.integers(-1, 3)), max_size=60))
def test_any_pulses_give_finite_results_or_none(pulses):
    record = read_record(PARAMETERS, pulses, [0.0, 2.0])
    assert record.pulses == len(pulses)
    for column in (*record.passages, record.sigma, record.sun_b, record.covariance):
        assert np.all(np.isfinite(column))
    assert np.all(np.abs(record.passages.angle) <= math.radians(60.0) + 1e-12)
    assert all(0 < reason < 10 for reason in record.refused)
    assert isinstance(record.refused, Counter)
