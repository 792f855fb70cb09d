# SPDX-License-Identifier: Apache-2.0
"""Readings that are older than their stamps, against turns in closed form."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from css_common.attitude import mrp_shadow, mrp_to_dcm
from css_common.mission import MissionError, load_mission
from css_common.random_streams import random_key
from css_sim.delayed import Delayed
from css_sim.latency import CELLS, GYRO, MAGNETOMETER, Latency, Moment, draw_lag, new_history, parameters, remember
from css_sim.latency import sensed as sensed_at

AXIS = np.array([0.36, -0.48, 0.8])
RATE = math.radians(2.0)  # [rad/s]


def attitude(t):
    """MRP after a turn of 180 deg at t = 0 about `AXIS` at `RATE`: its set changes there."""
    angle = math.pi + RATE * t
    return mrp_shadow(tuple(math.tan(0.25 * angle) * AXIS))


def moment(t):
    return Moment(attitude(t), (t, 2.0 * t, -t), (1.0, 0.0, t), 1.0 - 0.1 * t, (0.0, t, 0.0))


def sensed(lag, step, known, begin_s=-0.5, since=0):
    history = new_history(10.0)
    for k in known:
        remember(history, k, moment(begin_s + 0.1 * k))
    return sensed_at(history, step, lag, moment(begin_s + 0.1 * step), since)


@pytest.mark.parametrize("lag", [0.0, 1.0, 3.0, 10.0])
def test_whole_cycles_are_those_moments_to_the_bit(lag):
    step = 40
    assert sensed(lag, step, range(step + 1)) == moment(-0.5 + 0.1 * (step - int(lag)))


@pytest.mark.parametrize("lag", [0.25, 0.5, 3.9, 4.5, 5.5, 9.9])
def test_parts_of_cycles_lie_between_them(lag):
    """Step 10 is half a second after the turn of 180 deg, where the MRP set changes."""
    exact = moment(0.5 - 0.1 * lag)
    read = sensed(lag, 10, range(11))
    turn = np.array(mrp_to_dcm(read.sigma_bn)) @ np.array(mrp_to_dcm(exact.sigma_bn)).T
    assert Rotation.from_matrix(turn).magnitude() < 2e-6
    for name in ("omega_bn_b", "sun_n", "field_n", "intensity"):
        np.testing.assert_allclose(getattr(read, name), getattr(exact, name), atol=1e-12)


@pytest.mark.parametrize("lag", [2.0, 2.5])
def test_before_the_epoch_there_is_what_there_is_at_the_epoch(lag):
    assert sensed(lag, 1, range(2)) == moment(-0.5)
    assert sensed(lag, 0, range(1)) == moment(-0.5)


def test_a_restarted_sensor_takes_the_oldest_it_knows():
    assert sensed(5.0, 20, [18, 19, 20]) == moment(-0.5 + 0.1 * 18)
    assert sensed(5.0, 20, [20]) == moment(-0.5 + 0.1 * 20)
    assert sensed(5.0, 20, [*range(14), 17, 18, 19, 20]) == moment(-0.5 + 0.1 * 17)  # cycles 14 to 16 were missed


def test_a_sensor_that_is_switched_on_knows_nothing_from_before():
    assert sensed(5.0, 20, range(21), since=18) == moment(-0.5 + 0.1 * 18)
    assert sensed(5.5, 20, range(21), since=18) == moment(-0.5 + 0.1 * 18)
    assert sensed(5.0, 30, range(31), since=18) == moment(-0.5 + 0.1 * 25)


def test_a_node_remembers_what_it_hears():
    delayed = Delayed(Latency(2.0, 0.0), random_key(1, 0), GYRO)
    heard = [delayed(k, omega_bn_b=(float(k), 0.0, 0.0)).omega_bn_b[0] for k in range(6)]
    assert heard == [0.0, 0.0, 0.0, 1.0, 2.0, 3.0]


def test_latencies_of_cases_are_uniform_and_each_sensor_has_its_own():
    p = Latency(3.0, 2.0)
    drawn = np.array([[draw_lag(p, random_key(1, c), s) for s in (CELLS, GYRO, MAGNETOMETER)] for c in range(2000)])
    assert drawn.min() > 1.0 and drawn.max() < 5.0
    np.testing.assert_allclose(drawn.mean(axis=0), 3.0, atol=0.1)
    np.testing.assert_allclose(drawn.std(axis=0), 2.0 / math.sqrt(3.0), rtol=0.05)
    assert np.max(np.abs(np.corrcoef(drawn.T) - np.eye(3))) < 0.08
    assert draw_lag(Latency(3.0, 0.0), random_key(1, 9), CELLS) == 3.0


def test_a_latency_that_is_whole_but_for_rounding_is_whole():
    values = load_mission("okeefe_2013", ["gyro.latency=0.3"]).node("gyro").values
    assert 0.3 / 0.1 != 3.0 and parameters(values) == Latency(3.0, 0.0)
    values = load_mission("okeefe_2013", ["css_array.latency=0.025"]).node("css_array").values
    assert parameters(values).lag == pytest.approx(0.25)


@pytest.mark.parametrize("node", ["css_array", "gyro"])
def test_no_reading_comes_from_after_its_stamp(node):
    with pytest.raises(MissionError, match=r"latency_spread: 0\.2 given, expected at most latency"):
        load_mission("okeefe_2013", [f"{node}.latency=0.1", f"{node}.latency_spread=0.2"])
