# SPDX-License-Identifier: Apache-2.0
"""Cells that others outvote, or that are lit against the view of others."""

import numpy as np
import pytest
from turning_body import RING, SIX, TWELVE, Body, with_cell

from css_common import health

FACES = [normal for normal in SIX for _ in range(3)]  # three cells on each face
_LAYOUTS = {
    "8": (RING, 120.0),
    "6": (SIX, 180.0),
    "12": (TWELVE, 130.0),
    "18": (FACES, 180.0),
    "18 narrow": (FACES, 120.0),
}


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("layout", _LAYOUTS)
def test_uncalibrated_cells_in_the_light_of_the_earth_are_not_held_for_failed(layout, seed):
    body = Body(*_LAYOUTS[layout], seed=seed).uncalibrated()
    body.omega = np.radians(np.random.default_rng(seed).uniform(-1.5, 1.5, 3))
    assert body.fly(1500.0)[0] == 0


@pytest.mark.parametrize("i", [0, 4, 16])
def test_one_of_three_on_a_face_is_outvoted(i):
    body = Body(FACES, 180.0, seed=i).uncalibrated()
    body.sun = body.normals[i] * 0.5 + 0.8 * body.normals[(i + 6) % 18]
    body.sun /= np.linalg.norm(body.sun)
    body.omega = np.radians([0.1, -0.2, 0.1])
    assert body.fly(30.0)[0] == 0
    # less than what the Earth may give, so that no direction to the Sun contradicts it
    ever, _ = body.fly(30.0, with_cell(i, lambda v, t: v + 0.4))
    assert ever == 1 << i
    assert body.verdict(i).evidence == health.EVIDENCE_VOTE
    assert body.verdict(i).statistic > body.verdict(i).threshold


def test_a_cell_that_is_lit_against_two_is_left_out_before_the_sun_is_found():
    body = Body(RING, 120.0)
    body.omega = np.zeros(3)
    body.sun = np.array([-0.4, 0.1, 0.9]) / np.linalg.norm([-0.4, 0.1, 0.9])
    ever, first = body.fly(20.0, with_cell(4, lambda v, t: 0.9 + 0.01 * np.sin(t)))
    assert ever == 1 << 4
    assert body.verdict(4).evidence == health.EVIDENCE_OPPOSITE
    # a look adds what the least lit of the three is beyond the Earth, 3.1 sigma: 20 / (3.1^2 - 4) s
    assert first < 4.0


def test_one_of_a_pair_that_looks_both_ways_is_not_judged_by_that_alone():
    body = Body(SIX, 120.0)
    body.omega = np.zeros(3)
    body.sun = np.array([0.0, 0.0, 1.0])
    assert body.fly(10.0, with_cell(5, lambda v, t: 0.8 + 0.01 * np.sin(t)))[0] == 0
