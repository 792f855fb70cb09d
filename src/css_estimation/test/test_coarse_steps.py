# SPDX-License-Identifier: Apache-2.0
"""Telemetry of any step: healthy cells and a healthy gyro stay in use, a dead cell is found, what cannot be is said."""

import math

import numpy as np
import pytest

from css_common import health
from css_common.attitude import rotation_vector_to_dcm
from css_common.health import EVIDENCE_COMMON, SORT_CELL, SORT_GYRO
from css_common.schema import default_values
from css_estimation.health import watched
from css_estimation.health.coarse_steps import coarse_lines, longest_judged_step
from css_estimation.nodes.wavg import Wavg
from css_estimation.sun import wavg
from css_estimation.sun.heading_loop import loop_of, new_headings
from css_estimation.sun.sky_table import sky_table
from css_estimation.sun.sun_heading import Measured

NORMALS = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
ORBIT_S, SUNLIT = 5677.0, 0.64


def values_of(**changes):
    return default_values(Wavg.table(), cells__normals=NORMALS.ravel(), cells__field_of_view_deg=180.0, **changes)


def turning(times_s, axis, rate_deg_s):
    """Sun (M, 3) and rates (M, 3) of a body that turns evenly."""
    omega = math.radians(rate_deg_s) * np.array(axis) / np.linalg.norm(axis)
    sun = np.array([0.35, 0.2, 0.9]) / np.linalg.norm([0.35, 0.2, 0.9])
    return np.array([rotation_vector_to_dcm(tuple(t * omega)) @ sun for t in times_s]), np.tile(
        omega, (len(times_s), 1)
    )


def slewing(times_s, random):
    """The same of a body at rest that is turned, now and then, from one attitude to another."""
    times, at, attitude, omega = 0.0, 0, np.eye(3), np.zeros(3)
    sun = np.array([0.35, 0.2, 0.9]) / np.linalg.norm([0.35, 0.2, 0.9])
    suns, rates, ends = [], [], random.uniform(100.0, 900.0)
    while at < len(times_s):
        until = min(ends, times_s[at])
        attitude = np.array(rotation_vector_to_dcm(tuple((until - times) * omega))) @ attitude
        times = until
        if until == times_s[at]:
            suns.append(attitude @ sun)
            rates.append(omega)
            at += 1
        if until == ends:
            turns = not omega.any()
            axis = random.standard_normal(3)
            omega = math.radians(1.0) * axis / np.linalg.norm(axis) if turns else np.zeros(3)
            ends += random.uniform(30.0, 150.0) if turns else random.uniform(100.0, 900.0)
    return np.array(suns), np.array(rates)


def steps_of(step_s, count, random, irregular, gaps):
    steps = step_s * (np.exp(0.7 * random.standard_normal(count)) if irregular else np.ones(count))
    if gaps:
        steps[random.integers(1, count, 8)] += random.uniform(60.0, 20_000.0, 8)
    return np.round(np.cumsum(steps), 3)


def field_along(times_s):
    """Field of a dipole (M, 3) along a polar orbit [T]."""
    angle = 2.0 * math.pi * times_s[:, np.newaxis] / ORBIT_S
    up = np.cos(angle) * [1.0, 0.0, 0.0] + np.sin(angle) * [0.0, -0.13, 0.99]
    dipole = np.array([0.0, 0.17, -0.98])
    return 2.3e-5 * (3.0 * (up @ dipole)[:, np.newaxis] * up - dipole)


def judged(times_s, motion, random, *, dead=None, rounded=None, missing=None, read=None, field=None):
    """What each cycle came to, and the verdicts at the end, of a recording with shadows.

    Args:
        motion: Sun (M, 3) and rates (M, 3).
        read: what the gyro reads instead of the rates and noise.
        field: what the magnetometer reads [T].
    """
    sun, rates = motion
    outputs = np.maximum(sun @ NORMALS.T, 0.0)
    outputs[times_s % ORBIT_S > SUNLIT * ORBIT_S] = 0.0
    outputs += 0.005 * random.standard_normal(outputs.shape)
    if dead is not None:
        outputs[len(outputs) // 3 :, dead] = 0.005 * random.standard_normal(len(outputs) - len(outputs) // 3)
    if missing is not None:
        outputs[missing] = math.nan
    if read is None:
        read = rates + math.radians(0.03) * random.standard_normal(rates.shape)
    if rounded is not None:
        read = np.round(read, rounded)
    p = watched.watched_parameters(wavg, values_of(rate__use_field=field is not None))
    memory = watched.initial_memory(wavg, p)
    count = len(times_s)
    out, no_speeds = new_headings(count), np.zeros((count, 0))
    gyro, none = np.ones(count, bool), np.zeros(count, bool)
    fields, there = (np.zeros((count, 3)), none) if field is None else (field, gyro)
    measured = Measured(outputs, read, gyro, fields, there, no_speeds, False)
    since = np.diff(times_s, prepend=2.0 * times_s[0] - times_s[1])
    sky = sky_table(None, np.round(times_s * 1e9).astype(np.int64).tolist())
    state = watched.initial_state(wavg, p)
    loop_of(wavg.__name__)(p, state, memory, since, measured, *sky, out)
    return out, health.verdicts_of(watched.verdicts_of(memory))


@pytest.mark.parametrize("step_s", [1.0, 5.0, 10.0, 20.0, 60.0, 600.0, 3600.0])
@pytest.mark.parametrize(("irregular", "gaps"), [(False, False), (True, False), (False, True)])
def test_healthy_sensors_stay_in_use(step_s, irregular, gaps):
    random = np.random.default_rng(7)
    times = steps_of(step_s, 500, random, irregular, gaps)
    motions = [turning(times, (0.3, 0.5, 0.8), 1.0), turning(times, (0.1, 0.2, 0.95), 8.0), slewing(times, random)]
    motions.append(turning(times, (0.0, 1.0, 0.0), 360.0 / ORBIT_S))
    for sun, rates in motions:
        out, _ = judged(times, (sun, rates), random)
        assert not out.isolated.any() and not out.sensors_left.any()


@pytest.mark.parametrize("step_s", [1.0, 5.0, 10.0, 60.0, 600.0, 3600.0])
def test_a_healthy_magnetometer_stays_in_use(step_s):
    for axis, rate_deg_s in (((0.3, 0.5, 0.8), 1.0), ((0.1, 0.2, 0.95), 8.0), ((0.0, 1.0, 0.0), 360.0 / ORBIT_S)):
        random = np.random.default_rng(8)
        times = steps_of(step_s, 1000, random, False, True)
        omega = math.radians(rate_deg_s) * np.array(axis) / np.linalg.norm(axis)
        attitudes = np.array([rotation_vector_to_dcm(tuple(t * omega)) for t in times])
        field = np.einsum("kij,kj->ki", attitudes, field_along(times)) + 1e-7 * random.standard_normal((1000, 3))
        out, _ = judged(times, turning(times, axis, rate_deg_s), random, field=field)
        assert not out.isolated.any() and not out.sensors_left.any()


def test_shadows_either_side_of_a_gap_are_no_dead_board():
    random = np.random.default_rng(3)
    night = 0.8 * ORBIT_S
    times = np.concatenate([np.arange(0.0, night, 10.0), np.arange(3.0 * ORBIT_S + night, 5.0 * ORBIT_S, 10.0)])
    out, _ = judged(times, turning(times, (0.3, 0.5, 0.8), 1.0), random)
    assert not out.isolated.any()


def test_lines_without_cells_are_no_darkness():
    random = np.random.default_rng(4)
    times = np.arange(0.0, 2.0 * ORBIT_S, 20.0)
    begin = np.searchsorted(times, 0.8 * ORBIT_S)
    missing = (np.arange(len(times)) > begin) & (times < 1.7 * ORBIT_S)
    out, _ = judged(times, turning(times, (0.3, 0.5, 0.8), 1.0), random, missing=missing)
    assert not out.isolated.any()


@pytest.mark.parametrize("step_s", [10.0, 60.0, 600.0])
def test_a_dead_board_is_one_at_any_step_shorter_than_a_day(step_s):
    random = np.random.default_rng(5)
    times = np.arange(0.0, 6.0 * ORBIT_S, step_s)
    sun, rates = turning(times, (0.3, 0.5, 0.8), 1.0)
    sun[times > ORBIT_S] = 0.0
    out, verdicts = judged(times, (sun, rates), random)
    assert out.isolated[-1] == 0b111111
    assert {v.evidence for v in verdicts if v.sort == SORT_CELL} == {EVIDENCE_COMMON}


@pytest.mark.parametrize("step_s", [20.0, 60.0, 600.0])
def test_a_dead_cell_is_found_by_lines_that_stand_alone(step_s):
    for dead in range(6):
        random = np.random.default_rng(11)
        times = np.arange(600) * step_s
        sun = random.standard_normal((600, 3))
        sun /= np.linalg.norm(sun, axis=1)[:, np.newaxis]
        out, verdicts = judged(times, (sun, np.zeros((600, 3))), random, dead=dead)
        assert out.isolated[-1] == 1 << dead and not np.any(out.isolated & ~(1 << dead))
        assert not out.isolated[:200].any()
        assert [(v.kind, v.evidence) for v in verdicts if v.sort == SORT_CELL] == [
            (health.KIND_DEAD, health.EVIDENCE_DEAD)
        ]


def test_of_two_cells_that_explain_the_same_none_is_named():
    """The Sun never leaves one side: the dark cell there and the one opposite tell the same."""
    random = np.random.default_rng(12)
    sun = random.standard_normal((400, 3))
    sun[:, 0] = np.abs(sun[:, 0]) + 1.0
    sun /= np.linalg.norm(sun, axis=1)[:, np.newaxis]
    out, _ = judged(np.arange(400) * 600.0, (sun, np.zeros((400, 3))), random, dead=0)
    assert not out.isolated.any()


@pytest.mark.parametrize("decimals", [2, 3, 4])
@pytest.mark.parametrize("step_s", [1.0, 60.0])
def test_a_gyro_in_rounded_telemetry_is_not_stuck(step_s, decimals):
    random = np.random.default_rng(13)
    times = np.arange(1000) * step_s
    out, _ = judged(times, slewing(times, random), random, rounded=decimals)
    assert not out.sensors_left.any()


def test_a_gyro_that_freezes_is_stuck_also_at_a_step_of_a_minute():
    random = np.random.default_rng(14)
    times = np.arange(400) * 60.0
    sun, rates = turning(times, (0.3, 0.5, 0.8), 1.0)
    read = rates + math.radians(0.03) * random.standard_normal(rates.shape)
    read[200:, 1] = read[200, 1]
    out, verdicts = judged(times, (sun, rates), random, read=read)
    assert [v.unit for v in verdicts if v.sort == SORT_GYRO] == [1]
    assert not out.sensors_left[:200].any()


def test_what_steps_are_too_long_for_is_said():
    values = values_of()
    fine, minutes = np.arange(100) * 1_000_000_000, np.arange(100) * 600_000_000_000
    assert coarse_lines(values, fine) == []
    cells, gyro = coarse_lines(values, minutes)
    assert "99 of 99 steps are longer than 10 s" in cells and "not held against the Sun" in gyro
    assert 10.0 < longest_judged_step(values) < 30.0
    # a few gaps are no coarse recording
    gaps = fine.copy()
    gaps[50:] += 10**13
    assert coarse_lines(values, gaps) == []
    assert coarse_lines(values_of(health__enabled=False), minutes) == []
    assert len(coarse_lines(values_of(use_gyro=False), minutes)) == 1
