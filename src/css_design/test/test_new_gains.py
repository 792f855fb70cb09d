# SPDX-License-Identifier: Apache-2.0
"""Gains of new missions: what wheels can do in every direction, and margins against closed forms."""

import math

import numpy as np
import pytest

from css_common.component import Smoothing
from css_design.errors import DesignError
from css_design.new_mission.design import substeps_of
from css_design.new_mission.gains import DAMPING, LEAST_MARGIN_DB, Capacity, capacity, designed, gain_margin_db
from css_sim.rigid_body import LARGEST_ANGLE
from sunpoint_control.loop_stability import Gains, LoopModel

INERTIA = np.diag([0.05, 0.04, 0.02])


def model(period=0.1, rate=1.0):
    return LoopModel(INERTIA, np.array([0.0, 0.0, 1.0]), np.eye(3), period, Smoothing(rate=rate), True, False)


def test_three_wheels_do_in_every_direction_what_one_does():
    assert capacity(np.eye(3), 0.002, 0.01) == pytest.approx((0.002, 0.01))


def test_capacity_is_the_least_over_all_directions():
    generator = np.random.default_rng(1)
    s = 1.0 / math.sqrt(3.0)
    axes = s * np.array([[1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [-1.0, -1.0, 1.0], [1.0, -1.0, 1.0]])
    ways = generator.normal(size=(20_000, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    most = 1.0 / np.max(np.abs(ways @ np.linalg.pinv(axes.T).T), axis=1)  # torque at which the first wheel saturates
    found = capacity(axes, 1.0, 2.0)
    assert found.torque == pytest.approx(most.min(), rel=1e-3) and found.torque <= most.min()
    assert found.momentum == pytest.approx(2.0 * found.torque)


def test_the_margin_of_pure_damping_is_a_closed_form():
    """omega_k+1 = (1 - h P / I) omega_k: stable while h P / I < 2, by the smallest moment."""
    p = 0.01
    margin = gain_margin_db(model(), Gains(0.0, p, 0.0))
    assert margin == pytest.approx(20.0 * math.log10(2.0 * 0.02 / (0.1 * p)), abs=0.02)


def test_an_unstable_loop_has_no_margin():
    assert gain_margin_db(model(), Gains(0.0, 0.5, 0.0)) == -math.inf
    assert gain_margin_db(model(), Gains(0.01, -0.01, 0.0)) == -math.inf


@pytest.mark.parametrize(
    ("wheels", "corner", "limit"),
    [
        (Capacity(1e-5, 1.0), 0.1, "the torque of the wheels"),
        (Capacity(1.0, 1e-3), 0.1, "the momentum of the wheels"),
        (Capacity(1.0, 1.0), 0.1, "the low-pass on the rate"),
        (Capacity(1e3, 1e3), 1000.0, "the sampled loop's gain margin"),
    ],
)
def test_each_limit_limits(wheels, corner, limit):
    loop = designed(model(), wheels, corner)
    assert loop.limit == limit
    assert loop.margin_db >= LEAST_MARGIN_DB - 0.1
    moment = 0.05
    assert loop.gains.k == pytest.approx(4.0 * moment * loop.bandwidth**2, rel=6e-3)
    assert loop.gains.p == pytest.approx(2.0 * DAMPING * moment * loop.bandwidth, rel=6e-3)
    # 90 deg off the wheels give what is asked, and a turn from far leaves half of their momentum
    assert loop.gains.k * math.tan(math.radians(22.5)) <= wheels.torque * 1.01
    assert moment * loop.gains.k / loop.gains.p <= 0.5 * wheels.momentum * 1.02


def test_no_gains_for_a_cycle_of_ages():
    with pytest.raises(DesignError, match="--period: 1e"):
        designed(model(period=1e6), Capacity(1.0, 1.0), 0.1)


def test_substeps_keep_the_turn_of_a_step_small():
    assert substeps_of(3.0, 0.1) == 1
    rate = 3600.0
    steps = substeps_of(rate, 1.0)
    assert math.radians(rate) / steps <= LARGEST_ANGLE < math.radians(rate) / (steps - 1)
