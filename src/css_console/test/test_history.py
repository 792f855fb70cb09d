# SPDX-License-Identifier: Apache-2.0
"""The memory of the strip charts is bounded and loses no peak."""

import numpy as np
import pytest

from css_console.history import History


def test_what_is_short_is_kept_as_it_is():
    history = History(2, most=64)
    for k in range(64):
        history.add(0.5 * k, [k, -k])
    assert history.columns().tolist() == [[0.5 * k for k in range(64)], list(range(64)), [-k for k in range(64)]]


@pytest.mark.parametrize("count", [65, 1_000, 20_000])
def test_peaks_survive_and_time_goes_forward(count):
    rng = np.random.default_rng(1)
    values = rng.normal(size=(count, 3))
    peaks = rng.choice(count, 6, replace=False)
    for column, (low, high) in enumerate(peaks.reshape(3, 2)):
        values[low, column], values[high, column] = -100.0 - column, 100.0 + column
    history = History(3, most=64)
    for k, row in enumerate(values):
        history.add(float(k), row.tolist())
        assert len(history) <= 64
    columns = history.columns()
    assert np.all(np.diff(columns[0]) > 0.0)
    assert columns[0, 0] == 0.0 and columns[0, -1] == count - 1
    assert columns[1:].min(axis=1).tolist() == [-100.0, -101.0, -102.0]
    assert columns[1:].max(axis=1).tolist() == [100.0, 101.0, 102.0]


def test_gaps_stay_gaps_where_nothing_else_is():
    history = History(1, most=64)
    for k in range(200):
        history.add(float(k), [float("nan") if k < 100 else 1.0])
    columns = history.columns()
    assert np.isnan(columns[1, columns[0] < 80]).all()
    assert (columns[1, columns[0] > 120] == 1.0).all()


def test_what_was_drawn_stays_when_a_topic_joins():
    history = History(2, most=64)
    for k in range(3):
        history.add(float(k), [10.0 + k, 20.0 + k])
    history = history.rearranged([1, None, 0])
    history.add(3.0, [23.0, 33.0, 13.0])
    times, first, fresh, last = history.columns().tolist()
    assert (times, first, last) == ([0.0, 1.0, 2.0, 3.0], [20.0, 21.0, 22.0, 23.0], [10.0, 11.0, 12.0, 13.0])
    assert np.isnan(fresh[:3]).all() and fresh[3] == 33.0


def test_more_that_is_known_of_an_instant_takes_its_place():
    history = History(1, most=64)
    for time, value in ((0.0, 1.0), (0.0, 2.0), (1.0, 3.0), (1.0, float("nan")), (1.0, 4.0)):
        history.add(time, [value])
    assert history.columns().tolist() == [[0.0, 1.0], [2.0, 4.0]]
