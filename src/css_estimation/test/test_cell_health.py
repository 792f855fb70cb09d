# SPDX-License-Identifier: Apache-2.0
"""The health of cells: a body that turns in the Sun, cells that fail, and what is held for failed and why."""

import math

import numpy as np
import pytest
from turning_body import PERIOD, RING, SIX, TWELVE, Body, to_dcm, with_cell

from css_common import health
from css_estimation.health import cell_health
from css_estimation.sun.sun_heading import UNKNOWN_SKY


@pytest.mark.parametrize("gyro", [True, False], ids=["gyro", "no rate"])
@pytest.mark.parametrize(
    ("normals", "view"), [(RING, 120.0), (SIX, 180.0), (SIX[:4], 180.0)], ids=["ring", "six faces", "belt"]
)
def test_healthy_cells_are_not_held_for_failed(normals, view, gyro):
    body = Body(normals, view, gyro=gyro)
    assert body.fly(1500.0) == (0, pytest.approx(math.nan, nan_ok=True))


def test_the_common_direction_is_the_sun():
    body = Body()
    body.fly(60.0)
    sight = cell_health.sight(body.state)
    assert sight.known
    assert math.degrees(math.acos(np.dot(sight.sun_b, body.sun))) < 2.0
    assert 0.0 < math.degrees(math.sqrt(sight.variance)) < 5.0


KINDS = {
    "dead": (lambda v, t: 0.0, health.KIND_DEAD),
    "stuck": (lambda v, t: 0.53, health.KIND_STUCK),
    "too bright": (lambda v, t: 1.6, health.KIND_STUCK),
    "half": (lambda v, t: 0.5 * v, health.KIND_SCALED),
    "offset": (lambda v, t: v + 0.8, health.KIND_BIAS),
    "negative": (lambda v, t: -v - 0.2, health.KIND_SIGN),
    "grows": (lambda v, t: v + 0.02 * (t - 60.0), health.KIND_DRIFTING),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("i", range(0, 12, 2))
def test_a_cell_that_fails_is_found_and_named(kind, i):
    value, name = KINDS[kind]
    body = Body(TWELVE, 130.0, seed=i)
    assert body.fly(60.0)[0] == 0
    lit = body.normals[i]
    # begins anew such that the cell is in the Sun when it fails
    body.sun = lit * 0.9 + 0.2 * np.array([0.3, -0.5, 0.4])
    body.sun = np.array(to_dcm(tuple((-25.0 * body.omega).tolist()))) @ (body.sun / np.linalg.norm(body.sun))
    body.state = cell_health.initial_state()
    assert body.fly(25.0)[0] == 0
    ever, first = body.fly(140.0, with_cell(i, lambda v, t: value(v, t - 25.0)))
    # an error that grows draws the common direction with it before it shows
    assert ever == 1 << i or (kind == "grows" and ever >> i & 1)
    assert body.verdict(i).kind == name
    if kind in ("dead", "stuck", "too bright"):
        assert first - 85.0 < 10.0


@pytest.mark.parametrize("i", range(8))
def test_a_dead_cell_of_few_is_found(i):
    body = Body(seed=i)
    body.fly(60.0)
    body.sun = 0.9 * body.normals[i] + 0.2 * np.array([0.3, -0.5, 0.4])
    body.sun = np.array(to_dcm(tuple((-25.0 * body.omega).tolist()))) @ (body.sun / np.linalg.norm(body.sun))
    body.state = cell_health.initial_state()
    body.fly(25.0)
    ever, _ = body.fly(140.0, with_cell(i, lambda v, t: 0.0))
    if not body.state.isolated:
        pytest.skip("no other cell sees this one's Sun on the way")
    assert ever == 1 << i
    assert body.verdict(i).kind == health.KIND_DEAD
    assert body.verdict(i).evidence in (health.EVIDENCE_DEAD, health.EVIDENCE_RESIDUAL)


@pytest.mark.parametrize("i", range(8))
def test_leaps_are_noise_and_few_leaps_are_spikes(i):
    random = np.random.default_rng(i)
    noisy, spikes = Body(), Body()
    noisy.fly(30.0)
    spikes.fly(30.0)
    assert noisy.fly(60.0, with_cell(i, lambda v, t: v + 0.3 * random.standard_normal()))[0] == 1 << i
    assert noisy.verdict(i).kind == health.KIND_NOISY
    assert noisy.verdict(i).evidence in (health.EVIDENCE_NOISE, health.EVIDENCE_RANGE)
    assert spikes.fly(120.0, with_cell(i, lambda v, t: v + (0.5 if random.random() < 0.1 else 0.0)))[0] == 1 << i
    assert spikes.verdict(i).kind == health.KIND_SPIKES


def test_a_fault_from_the_start_is_found_with_the_sun():
    body = Body()
    ever, first = body.fly(60.0, with_cell(0, lambda v, t: 0.9))
    assert ever == 1
    assert first < 10.0
    assert math.degrees(math.acos(np.dot(cell_health.sight(body.state).sun_b, body.sun))) < 3.0


def test_a_sun_that_sets_speaks_against_no_cell():
    body = Body()
    body.fly(60.0)
    for share in np.linspace(1.0, 0.0, 80):
        body.light = share
        assert body.fly(PERIOD)[0] == 0
    assert body.fly(600.0)[0] == 0
    for share in np.linspace(0.0, 1.0, 80):
        body.light = share
        assert body.fly(PERIOD)[0] == 0
    assert body.fly(300.0)[0] == 0


def test_one_cell_that_is_bright_in_the_shadow_fails_and_two_are_the_day():
    night = UNKNOWN_SKY._replace(known=True, illumination=0.0)
    body = Body()
    body.fly(60.0)
    body.light, body.sky = 0.0, night
    body.fly(1.0)
    assert body.fly(59.0, with_cell(5, lambda v, t: v + 0.4))[0] == 0
    assert body.fly(10.0, with_cell(5, lambda v, t: v + 0.4))[0] == 1 << 5
    assert body.verdict(5).evidence == health.EVIDENCE_DARK
    day = Body()
    day.sky, day.omega = night, np.zeros(3)
    assert day.fly(300.0)[0] == 0


def test_a_cell_that_recovers_is_used_again_and_later_each_time():
    body = Body(health__cells__return_time=20.0)
    body.omega = np.radians([0.0, 0.0, 3.0])
    body.sun = np.array([0.3, 0.0, 0.954])
    body.fly(40.0)
    waited = []
    for _ in range(2):
        assert body.fly(60.0, with_cell(0, lambda v, t: 0.0))[0] == 1
        begun = body.time
        while body.state.isolated:
            body.fly(1.0)
            assert body.time - begun < 900.0
        waited.append(body.time - begun)
    assert 20.0 <= waited[0] < waited[1]


def test_missing_outputs_are_left_missing_and_nothing_is_said_of_them():
    body = Body()
    assert body.fly(120.0, with_cell(2, lambda v, t: math.nan))[0] == 0
    assert np.isnan(body.memory.trusted[2])
    assert np.isfinite(np.delete(body.memory.trusted, 2)).all()


def test_outputs_out_of_range_are_withheld_at_once():
    body = Body()
    body.fly(20.0)
    body.fly(PERIOD, with_cell(3, lambda v, t: 1.7))
    assert np.isnan(body.memory.trusted[3])
    assert body.state.isolated == 0
