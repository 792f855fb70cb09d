# SPDX-License-Identifier: Apache-2.0
"""Cells that go dark together: a dead board is told from an eclipse, from a late model and from cells that age."""

import math

import numpy as np
import pytest
from turning_body import PERIOD, RING, SIX, TWELVE, Body, to_dcm, with_cell

from css_common import health
from css_estimation.health.cell_memory import PHASE_SETTLED
from css_estimation.sun.sun_heading import UNKNOWN_SKY

DAY = UNKNOWN_SKY._replace(known=True, illumination=1.0)
NIGHT = DAY._replace(illumination=0.0)
_PENUMBRA = 8.0  # [s] the shortest of an orbit about the Earth


def in_the_sun(normals=RING, view_deg=120.0, faces=False) -> Body:
    """A body whose model of the orbit has had the Sun for long, and whose cells have found it.

    Args:
        faces: it stops as the Sun is nearly along z.
    """
    body = Body(normals, view_deg)
    body.sky = DAY
    body.omega = np.radians([0.3, -0.2, 0.1])
    if faces:
        body.omega = np.radians([1.3, -0.9, 0.4])
        along = np.array([0.1, 0.1, 0.99]) / np.linalg.norm([0.1, 0.1, 0.99])
        body.sun = np.array(to_dcm(tuple((-90.0 * body.omega).tolist()))) @ along
    assert body.fly(90.0)[0] == 0
    if faces:
        body.omega = np.zeros(3)
    assert body.state.track.phase == PHASE_SETTLED
    return body


def lit_cells(body: Body) -> int:
    """Mask of the cells that see the Sun for all of the next 20 s with much of its light."""
    return sum(1 << int(i) for i in np.flatnonzero(body.outputs() > 0.5))


def all_dark(v, t):
    return np.zeros_like(v)


def fade(body: Body, first: float, last: float, seconds: float) -> int:
    """The mask of cells held for failed while the Sun changes in brightness."""
    ever = 0
    for light in np.linspace(first, last, round(seconds / PERIOD)):
        body.light = light
        ever |= body.fly(PERIOD)[0]
    return ever


@pytest.mark.parametrize(("normals", "view"), [(RING, 120.0), (SIX, 180.0), (TWELVE, 130.0)], ids=["8", "6", "12"])
def test_a_dead_board_in_the_sun_is_found_and_is_no_night(normals, view):
    body = in_the_sun(normals, view)
    lit = lit_cells(body)
    assert body.fly(9.5, all_dark)[0] == 0
    ever, _ = body.fly(5.0, all_dark)
    assert lit and ever & lit == lit
    for i in range(len(body.normals)):
        if ever >> i & 1:
            assert body.verdict(i).kind == health.KIND_DEAD
            assert body.verdict(i).evidence == (health.EVIDENCE_COMMON if ever & (ever - 1) else health.EVIDENCE_DEAD)
            assert body.verdict(i).statistic > body.verdict(i).threshold
    # cells that cannot be told are left in use
    assert ever != (1 << len(body.normals)) - 1


def test_the_light_of_the_earth_on_other_cells_brings_no_dead_board_back():
    body = in_the_sun()
    lit = body.fly(15.0, all_dark)[0]
    assert lit

    def earthlit(v, t):
        return np.where([lit >> i & 1 for i in range(len(v))], 0.0, np.clip(0.4 + 0.1 * (v - 0.5), 0.0, 0.42))

    body.fly(120.0, earthlit)
    assert body.state.isolated & lit == lit


def test_the_only_lit_cell_dies_in_the_sun():
    body = in_the_sun(SIX, 120.0, faces=True)
    ever, _ = body.fly(15.0, with_cell(4, lambda v, t: 0.0))
    assert ever == 1 << 4
    assert body.verdict(4).evidence == health.EVIDENCE_DEAD


def test_a_board_that_comes_back_is_used_again():
    body = in_the_sun()
    assert body.fly(15.0, all_dark)[0]
    assert body.fly(1.0)[0] == body.state.isolated != 0  # no latch on a sample
    body.fly(9.0)
    assert body.state.isolated == 0
    # it has failed once: the next time it has to give light for longer
    assert body.fly(15.0, all_dark)[0]
    body.fly(7.0)
    assert body.state.isolated != 0
    body.fly(8.0)
    assert body.state.isolated == 0


@pytest.mark.parametrize("late", [0.0, 15.0, 55.0], ids="{:g} s late".format)
def test_a_sun_that_sets_before_the_model_says_so_is_no_dead_board(late):
    body = in_the_sun()
    assert fade(body, 1.0, 0.0, _PENUMBRA) == 0
    assert body.fly(late)[0] == 0
    body.sky = NIGHT
    assert body.fly(300.0)[0] == 0
    # and it rises after the model has it
    body.sky = DAY
    assert body.fly(late)[0] == 0
    assert fade(body, 0.0, 1.0, _PENUMBRA) == 0
    assert body.fly(120.0)[0] == 0


def test_slow_darkness_that_outlasts_a_late_model_is_a_fault():
    body = in_the_sun(SIX, 180.0, faces=True)
    assert fade(body, 1.0, 0.0, _PENUMBRA) == 0
    assert body.fly(60.0)[0] == 0
    assert body.fly(20.0)[0] != 0


def test_cells_that_age_together_are_not_dead():
    body = in_the_sun()
    assert fade(body, 1.0, 0.6, 600.0) == 0
    assert body.fly(300.0)[0] == 0


def test_without_a_gyro_nothing_is_said_in_the_dark():
    body = Body(gyro=False)
    body.sky = DAY
    assert body.fly(90.0)[0] == 0
    assert body.fly(120.0, all_dark)[0] == 0


def test_a_short_darkness_leaves_no_suspicion():
    body = in_the_sun()
    for _ in range(10):
        assert body.fly(9.0, all_dark)[0] == 0
        assert body.fly(20.0)[0] == 0


def test_without_a_model_only_what_outlasts_all_eclipses_is_a_fault():
    body = Body(SIX, 180.0, health__cells__longest_eclipse=100.0)
    assert body.fly(60.0)[0] == 0
    assert body.fly(99.0, all_dark)[0] == 0
    assert body.fly(3.0, all_dark)[0] == 0b111111
    assert {body.verdict(i).evidence for i in range(6)} == {health.EVIDENCE_COMMON}
    assert {body.verdict(i).kind for i in range(6)} == {health.KIND_DEAD}
    # one of them gives light: then the others may have been in the shade
    body.fly(10.0)
    assert body.state.isolated == 0
    assert body.fly(60.0)[0] == 0


def test_cells_that_do_not_see_all_of_the_sky_may_be_dark_for_ever():
    body = Body(SIX[:5], 120.0, health__cells__longest_eclipse=100.0)
    assert body.fly(60.0)[0] == 0
    assert body.fly(500.0, all_dark) == (0, pytest.approx(math.nan, nan_ok=True))
