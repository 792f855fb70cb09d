# SPDX-License-Identifier: Apache-2.0
"""Clouds that drift and are renewed: where they are, and the statistics that they keep."""

import math

import numpy as np
import pytest

from css_common.random_streams import random_key
from css_environment.constants import EARTH_RADIUS
from css_environment.moving_clouds import (
    CLOUD_STEP_NS,
    COMMON,
    CORRELATED,
    PER_CELL,
    CloudMotion,
    Clouds,
    draw_fields,
    draw_motion,
    fields_needed,
    is_cloud_step,
    likeness,
    reflect,
)
from css_environment.reflectivity import Reflectivity, draw_correlated, draw_reflectivity, zonal_reflectivity

EVEN = Reflectivity(np.full((36, 72), 0.5), np.full((36, 72), 0.05))  # no draw reaches the limits
LENGTH = math.radians(20.0)
DAY_NS = 86_400 * 10**9


def clouds(kind=PER_CELL, grid=EVEN, factor=1.0, limit=1.0):
    return Clouds(True, grid.mean, grid.std, likeness(grid, kind, LENGTH), factor, limit)


def reflected(motion, fields, elapsed_s, p=None):
    out = np.zeros(fields.shape[1:])
    reflect(clouds() if p is None else p, motion, fields, round(elapsed_s * 1e9), out)
    return out


def scores(motion, elapsed_s, kind=PER_CELL, cases=40, count=4):
    """(cases, rows, columns) deviations from the mean, in standard deviations."""
    p = clouds(kind)
    motions = [motion(case) if callable(motion) else motion for case in range(cases)]
    drawn = [draw_fields(EVEN, random_key(1, case), kind, LENGTH, count) for case in range(cases)]
    return (np.array([reflected(m, f, elapsed_s, p) for m, f in zip(motions, drawn, strict=True)]) - 0.5) / 0.05


@pytest.mark.parametrize("kind", [COMMON, PER_CELL, CORRELATED])
def test_clouds_that_stand_still_are_those_that_are_drawn_once(kind):
    grid, key, once = zonal_reflectivity(), random_key(4, 2), np.zeros((36, 72))
    if kind == CORRELATED:
        once = draw_correlated(grid, key, LENGTH)
    else:
        draw_reflectivity(grid, key, kind == COMMON, once)
    fields = draw_fields(grid, key, kind, LENGTH, 1)
    still = reflected(CloudMotion(0.0, 0.0, 0.0), fields, 7000.0, clouds(kind, grid))
    np.testing.assert_allclose(still, once, atol=1e-15)
    darker = reflected(CloudMotion(0.0, 0.0, 0.0), fields, 0.0, clouds(kind, grid, 1.5, 0.8))
    np.testing.assert_allclose(darker, np.minimum(1.5 * once, 0.8), atol=1e-15)


@pytest.mark.parametrize("columns", [3, -2])
def test_a_whole_column_of_drift_is_a_column_to_the_east(columns):
    fields = draw_fields(EVEN, random_key(1, 0), PER_CELL, LENGTH, 1)
    motion = CloudMotion(columns / 1000.0, 0.0, 0.0)
    np.testing.assert_allclose(
        reflected(motion, fields, 1000.0), np.roll(reflected(motion, fields, 0.0), columns, axis=1), atol=1e-15
    )


def test_the_speed_is_that_at_the_equator():
    motion = draw_motion(random_key(1, 0), 72, 20.0, 0.0, 0.0)
    assert motion.drift * DAY_NS * 1e-9 / 72 * 2.0 * math.pi * EARTH_RADIUS == pytest.approx(20.0 * 86_400.0)
    drawn = [draw_motion(random_key(1, case), 72, 20.0, 5.0, 3600.0) for case in range(2000)]
    speeds = np.array([m.drift for m in drawn]) / motion.drift * 20.0
    assert abs(speeds.mean() - 20.0) < 0.4 and abs(speeds.std() - 5.0) < 0.3
    phases = np.array([m.phase for m in drawn])
    assert abs(phases.mean() - 0.5) < 0.02 and abs(phases.std() - math.sqrt(1.0 / 12.0)) < 0.01
    assert drawn[0].renewal == pytest.approx(1.0 / 3600.0)


@pytest.mark.parametrize("kind", [PER_CELL, CORRELATED])
@pytest.mark.parametrize("part", [0.0, 0.31, 0.5])
def test_no_part_of_a_column_or_of_an_interval_dims_the_contrast(kind, part):
    g = scores(CloudMotion(part / 100.0, part / 100.0, 0.0), 100.0, kind)
    assert np.mean(g**2) == pytest.approx(1.0, abs=0.02 if kind == PER_CELL else 0.12)
    if kind == PER_CELL:
        assert np.mean(g[:, 18] ** 2) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("s", [0.1, 0.5, 0.9])
def test_clouds_forget_what_they_were(s):
    cases, interval = 100, 10_000.0

    def motion(case):
        return CloudMotion(0.0, 1.0 / interval, (case + 0.5) / cases)

    before, after = (scores(motion, t, cases=cases) for t in (0.0, s * interval))
    expected = (1.0 - 0.5 * s) * math.cos(0.5 * math.pi * s) + math.sin(0.5 * math.pi * s) / math.pi
    assert np.mean(before * after) == pytest.approx(expected, abs=0.01)


def test_clouds_of_correlated_fields_stay_correlated_over_their_angle():
    g = scores(CloudMotion(0.37 / 100.0, 0.6 / 100.0, 0.0), 100.0, CORRELATED, cases=100, count=2)
    expected = math.exp(-0.5 * (math.radians(20.0) / LENGTH) ** 2)
    assert np.mean(g[:, 10] * g[:, 14]) == pytest.approx(expected, abs=0.08)
    # between columns a field is smoothed once more, here by less than a percent
    assert np.mean(g[:, 18] * np.roll(g[:, 18], 4, axis=1)) == pytest.approx(expected, abs=0.08)


def test_the_deviations_are_those_of_the_latitude():
    """O'Keefe & Schaub 2013, Fig. 4b: what clouds add follows the deviation of the place that they are over."""
    zonal = zonal_reflectivity()
    grid = Reflectivity(np.full((36, 72), 0.5), 0.2 * zonal.std)
    p, motion = clouds(PER_CELL, grid), CloudMotion(0.004, 0.0007, 0.3)
    drawn = [reflected(motion, draw_fields(grid, random_key(1, c), PER_CELL, LENGTH, 4), 777.0, p) for c in range(40)]
    std = np.std(np.array(drawn), axis=(0, 2))
    np.testing.assert_allclose(std, grid.std[:, 0], rtol=0.06)
    assert zonal.std[18, 0] == pytest.approx(0.168) and zonal.std[0, 0] == pytest.approx(0.024)  # equator, south pole


def test_clouds_stand_still_between_their_steps():
    fields = draw_fields(EVEN, random_key(1, 0), PER_CELL, LENGTH, 3)
    motion = CloudMotion(1e-4, 1e-4, 0.2)
    first, same, other = (reflected(motion, fields, t) for t in (20.0, 29.9, 30.0))
    np.testing.assert_array_equal(first, same)
    assert not np.array_equal(first, other)
    moved = [is_cloud_step(k * 10**8, 10**8) for k in range(301)]
    assert [k for k, moves in enumerate(moved) if moves] == [0, 100, 200, 300]
    assert CLOUD_STEP_NS == 10 * 10**9


def test_a_flight_has_fields_to_its_end():
    for interval, duration in ((100.0, 5550.0), (5550.0, 5550.0), (1e6, 5550.0)):
        last = 1.0 + duration / interval  # the latest phase
        assert fields_needed(interval, duration) > math.floor(last) + 1
    assert fields_needed(0.0, 5550.0) == 1
