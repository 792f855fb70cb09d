# SPDX-License-Identifier: Apache-2.0
"""A thinned series keeps its extremes, its gaps and its ends, whatever it is."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from css_report.body_map import path_rows
from css_report.looks import Look
from css_report.thinning import kept_rows, merged_spans
from css_report.traces import band

LOOK = Look("#000000", "solid")
VALUES = arrays(np.float64, st.integers(1, 400), elements=st.floats(-1e6, 1e6) | st.just(np.nan))


@given(VALUES, st.integers(1, 40))
def test_extremes_gaps_and_ends_are_kept(values, bins):
    rows = kept_rows(values, bins)
    assert np.all(np.diff(rows) > 0) and rows[0] == 0 and rows[-1] == len(values) - 1
    known, kept = values[~np.isnan(values)], values[rows][~np.isnan(values[rows])]
    if len(known):
        assert kept.min() == known.min() and kept.max() == known.max()
    assert np.isnan(values).any() == np.isnan(values[rows]).any()
    assert len(rows) <= max(3 * bins + 2, 2 * bins)


@given(st.integers(0, 99_999), st.sampled_from([-1.0, 1.0]))
def test_a_spike_of_one_sample_survives(at, sign):
    values = np.sin(np.arange(100_000) / 3000.0)
    values[at] = sign * 7.0
    assert at in kept_rows(values)


def test_short_series_are_whole():
    assert kept_rows(np.zeros(3000)).tolist() == list(range(3000))


def test_a_gap_stays_between_what_it_divides():
    values = np.concatenate((np.ones(5000), np.full(5000, np.nan), np.full(5000, 2.0)))
    rows = kept_rows(values, 100)
    drawn = values[rows]
    first, last = np.flatnonzero(np.isnan(drawn))[[0, -1]]
    assert np.all(drawn[:first] == 1.0) and np.all(drawn[last + 1 :] == 2.0)


def test_spans_are_joined_over_gaps_that_nobody_sees():
    begin, end = merged_spans(np.array([0.0, 1.05, 3.0]), np.array([1.0, 2.0, 3.0]), 0.1)
    assert begin.tolist() == [0.0, 3.0] and end.tolist() == [2.0, 3.0]


def test_a_path_is_drawn_in_small_steps_and_broken_at_gaps():
    turn = np.linspace(0.0, 2.0 * np.pi, 20_001)
    directions = np.column_stack((np.cos(turn), np.sin(turn), np.zeros(len(turn))))
    directions[5000:6000] = np.nan
    rows = path_rows(directions)
    assert 600 < len(rows) < 800
    known = directions[rows]
    steps = np.degrees(np.arccos(np.clip(np.sum(known[1:] * known[:-1], axis=1), -1.0, 1.0)))
    assert np.nanmax(steps) < 0.6 and np.isnan(known).any()
    assert {4999, 6000} <= set(rows.tolist())


def test_a_band_has_no_area_over_a_gap():
    low, high = np.arange(9.0), np.arange(9.0) + 1.0
    low[3], high[6] = np.nan, np.nan
    traces = band("5 to 95 %", np.arange(9.0), low, high, LOOK)
    areas = [(list(below["x"]), list(above["x"])) for below, above in zip(traces[::2], traces[1::2], strict=True)]
    assert areas == [([0, 1, 2],) * 2, ([4, 5],) * 2, ([7, 8],) * 2]
    for below, above in zip(traces[::2], traces[1::2], strict=True):
        np.testing.assert_array_equal(above["y"] - below["y"], 1.0)
        assert above["fill"] == "tonexty"
    assert band("none", np.arange(2.0), np.full(2, np.nan), np.ones(2), LOOK) == []
