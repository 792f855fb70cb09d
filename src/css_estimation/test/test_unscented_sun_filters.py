# SPDX-License-Identifier: Apache-2.0
"""The two unscented Sun filters: closed forms, a turning body, darkness, and whether they are as good as they say."""

import math
from typing import Any

import numpy as np
import pytest
from okeefe_spacecraft import okeefe_values
from scipy.stats import chi2

from css_common.attitude import rotation_vector_to_dcm
from css_common.vectors import angle_between, multiply, scale
from css_estimation.sun import sunline_suekf, sunline_ukf
from css_estimation.sun.sun_heading import RATE_SUN, UNAIDED, VALIDITY_HELD, VALIDITY_VALID
from css_estimation.sun.unscented_cycle import (
    MODE_COASTING,
    MODE_LOST,
    MODE_PROPAGATING,
    MODE_STARTED,
    MODE_TRACKING,
)
from css_sensors.cells import CELLS

BOTH = pytest.mark.parametrize("algorithm", [sunline_ukf, sunline_suekf], ids=["sunline_ukf", "sunline_suekf"])
DT = 0.1
CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / math.sqrt(3.0)
IDEAL: dict[str, Any] = {
    "cells__normals": CORNERS.ravel().tolist(),
    "cells__clip_normal": [0.0, 0.0, 0.0],
    "cells__field_of_view_deg": 180.0,
    "gate_kind": "absolute",
    "gate": 0.0,
    "minimum_output": 0.0,
    "cell_sigma": 0.02,
}
"""Cells that follow the cosine over their half space: a Sun anywhere is seen by four of them, by three at least."""
SUN_B = (0.48, 0.6, 0.64)


class Filter:
    """An algorithm with what it carries."""

    def __init__(self, algorithm, **changes):
        self.algorithm = algorithm
        self.p = algorithm.parameters(okeefe_values(CELLS + algorithm.PARAMETERS, **(IDEAL | changes)))
        self.state, self.memory = algorithm.initial_state(self.p), algorithm.initial_memory(self.p)

    def step(self, voltages, dt=DT, omega=None):
        aiding = UNAIDED if omega is None else UNAIDED._replace(gyro_b=omega, gyro_valid=True)
        self.state, heading = self.algorithm.step(self.p, self.state, self.memory, dt, voltages, aiding)
        return heading


def turned(sun_b, omega, dt=DT):
    return multiply(rotation_vector_to_dcm(scale(dt, omega)), sun_b)


def outputs(sun_b):
    return np.maximum(CORNERS @ sun_b, 0.0)


def across(omega, sun_b):
    return np.subtract(omega, np.dot(omega, sun_b) * np.array(sun_b))


def dark():
    return np.zeros(len(CORNERS))


@BOTH
@pytest.mark.parametrize("light", [1.0, 0.93])
def test_a_sun_at_rest_that_three_cells_see_is_found_exactly(algorithm, light):
    """The average errs by degrees, the filter ends where the cells agree, whatever the light."""
    filter = Filter(algorithm, gate=0.1)
    sun_b = (0.8, 0.36, 0.48)
    voltages = light * outputs(sun_b)
    assert np.count_nonzero(voltages > 0.1) == 3
    first = filter.step(voltages)
    assert first.mode == MODE_STARTED
    for _ in range(600):
        heading = filter.step(voltages)
    assert heading.mode == MODE_TRACKING
    assert heading.lit_mask.bit_count() in (3, 4)
    assert math.degrees(angle_between(heading.sun_b, sun_b)) < 0.01
    # what the start left decays with the time in which the light is learnt
    assert np.abs(heading.omega_bn_b).max() < 1e-4
    length = np.linalg.norm(filter.memory.x[:3]) if algorithm is sunline_ukf else filter.memory.x[5]
    assert length == pytest.approx(light, abs=1e-3)


@BOTH
@pytest.mark.parametrize("omega", [(0.0, 0.01, 0.0), (0.006, 0.0, -0.008), (-0.01, 0.005, 0.0)])
def test_the_rate_is_that_of_the_body_across_the_sun_line(algorithm, omega):
    filter = Filter(algorithm)
    sun_b = SUN_B
    for _ in range(600):
        sun_b = turned(sun_b, omega)
        heading = filter.step(outputs(sun_b))
    assert heading.rate_source == RATE_SUN
    assert math.degrees(angle_between(heading.sun_b, sun_b)) < 0.1
    # the low-pass on the rate lags behind by a time constant of 1.6 s
    np.testing.assert_allclose(heading.omega_bn_b, across(omega, sun_b), atol=4e-4)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_switch_changes_the_frame_and_nothing_else(axis, sign):
    """The rate in b and its covariance with the direction are the same before and after."""
    rng = np.random.default_rng(7)
    memory = Filter(sunline_suekf).memory
    sun_b = np.array([0.25, 0.25, 0.1])
    sun_b[axis] = sign
    sun_b /= np.linalg.norm(sun_b)
    a = rng.normal(size=(6, 6))
    memory.x[:] = [*sun_b, 0.01, -0.02, 1.0]
    memory.root[:] = np.linalg.cholesky(a @ a.T)

    def in_b(axis):
        to_b = np.zeros((7, 6))
        to_b[:3, :3], to_b[6, 5] = np.eye(3), 1.0
        to_b[3:6, 3:5] = np.column_stack(sunline_suekf.rate_axes(tuple(sun_b.tolist()), axis))
        return to_b @ memory.x, to_b @ memory.root @ memory.root.T @ to_b.T

    x, covariance = in_b(axis)
    assert sunline_suekf.switch_axis(axis, memory) == 1 - axis
    x_after, covariance_after = in_b(1 - axis)
    np.testing.assert_allclose(x_after, x, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(covariance_after, covariance, rtol=1e-10, atol=1e-12)
    assert sunline_suekf.switch_axis(1 - axis, memory) == 1 - axis


def test_no_direction_is_without_a_frame():
    """The Sun goes through both axes and their opposites: neither heading nor rate sees it.

    The mean of rates that are read off in a frame that turns is off by their variance, most before a switch.
    """
    filter = Filter(sunline_suekf)
    omega, sun_b = (0.0, 0.0, 0.05), (1.0, 0.0, 0.0)
    axes = set()
    for k in range(2500):
        sun_b = turned(sun_b, omega)
        heading = filter.step(outputs(sun_b))
        axes.add(filter.state.axis)
        if k > 300:
            assert math.degrees(angle_between(heading.sun_b, sun_b)) < 0.05
            np.testing.assert_allclose(heading.omega_bn_b, omega, atol=0.01 * omega[2])
    assert axes == {0, 1}
    assert k * DT * omega[2] > 2.0 * math.pi


def test_prediction_is_a_turn_about_the_rate():
    """In the dark, without gyro, from the rate that the light left: exact, where a straight step errs."""
    filter = Filter(sunline_suekf, rate_process_sigma=1e-4)
    sun_b = SUN_B
    omega = tuple((0.03 * np.cross(sun_b, (0.0, 0.6, 0.8))).tolist())
    for _ in range(600):
        sun_b = turned(sun_b, omega)
        filter.step(outputs(sun_b))
    error = []
    for _ in range(200):
        sun_b = turned(sun_b, omega)
        heading = filter.step(dark())
        error.append(angle_between(heading.sun_b, sun_b))
    assert (heading.mode, heading.validity) == (MODE_COASTING, VALIDITY_HELD)
    assert math.degrees(max(error)) < 0.02


@BOTH
def test_a_gyro_carries_the_heading_through_the_dark(algorithm):
    filter = Filter(algorithm)
    sun_b = SUN_B
    for _ in range(300):
        filter.step(outputs(sun_b))
    certain = filter.step(outputs(sun_b)).covariance
    for k in range(3000):
        omega = (0.02 * math.sin(0.01 * k), -0.01, 0.015)
        sun_b = turned(sun_b, omega)
        heading = filter.step(dark(), omega=omega)
    assert heading.mode == MODE_PROPAGATING
    assert math.degrees(angle_between(heading.sun_b, sun_b)) < 0.1
    assert heading.age == pytest.approx(3000 * DT)
    assert np.trace(np.reshape(certain, (3, 3))) < np.trace(np.reshape(heading.covariance, (3, 3))) < 0.1
    heading = filter.step(outputs(sun_b), omega=omega)
    assert heading.mode == MODE_TRACKING


@BOTH
def test_the_rate_of_the_gyro_goes_on_without_it(algorithm):
    """Both silent and dark: the filter coasts at the last rate that was measured."""
    filter = Filter(algorithm)
    omega, sun_b = (0.0, -0.03, 0.0), (0.6, 0.0, 0.8)
    for _ in range(100):
        filter.step(outputs(sun_b))
    for k in range(200):
        sun_b = turned(sun_b, omega)
        heading = filter.step(dark(), omega=omega if k < 100 else None)
    assert heading.mode == MODE_COASTING
    assert math.degrees(angle_between(heading.sun_b, sun_b)) < 0.1


@BOTH
def test_what_is_lost_in_the_dark_is_held_and_found_again(algorithm):
    filter = Filter(algorithm)
    for _ in range(50):
        filter.step(outputs(SUN_B))
    for _ in range(6000):
        heading = filter.step(dark())
    assert (heading.mode, heading.validity, heading.covariance[0]) == (MODE_LOST, VALIDITY_HELD, -1.0)
    other_b = (0.0, -0.6, 0.8)
    heading = filter.step(outputs(other_b))
    assert (heading.mode, heading.validity) == (MODE_STARTED, VALIDITY_VALID)
    for _ in range(300):
        heading = filter.step(outputs(other_b))
    assert math.degrees(angle_between(heading.sun_b, other_b)) < 0.1


@BOTH
def test_after_a_long_step_it_starts_anew(algorithm):
    filter = Filter(algorithm, longest_step=5.0)
    for _ in range(50):
        filter.step(outputs(SUN_B))
    assert filter.step(outputs(SUN_B), dt=4.9).mode == MODE_TRACKING
    assert filter.step(outputs(SUN_B), dt=5.1).mode == MODE_STARTED


def test_a_cell_that_should_be_lit_and_is_dark_tells_where_the_sun_is_not():
    """Cells of a narrow view: with two of them lit the Sun is where no third one sees it. One filter knows that."""
    narrow = {"cells__field_of_view_deg": 120.0, "gate_kind": "relative", "gate": 0.4}
    sun_b = (0.0, math.sqrt(0.5), math.sqrt(0.5))
    lit = CORNERS @ sun_b
    voltages = np.where(lit >= 0.5, lit, 0.0)
    assert np.count_nonzero(voltages) == 2

    def seen_from_wrong(algorithm):
        filter = Filter(algorithm, **narrow)
        filter.step(voltages)
        filter.memory.x[:3] = (0.0, -0.2, math.sqrt(1.0 - 0.2**2))  # in the view of the two dark ones beside them
        filter.memory.root[:] = np.diag([0.1, 0.1, 0.1, 1e-3, 1e-3, 1e-3])
        for _ in range(300):
            heading = filter.step(voltages)
        return CORNERS @ heading.sun_b >= 0.5

    assert np.array_equal(seen_from_wrong(sunline_suekf), voltages > 0.0)
    assert np.count_nonzero(seen_from_wrong(sunline_ukf)) == 4


RUNS, STEPS, SETTLED = 40, 400, 100
RATE_WALK = 0.002


def fly_consistent(algorithm, seed):
    """NEES of the direction on its two axes, NIS and its degrees of freedom, on a body whose rate wanders.

    The body turns across the Sun line alone: a turn about it makes the rate across it change in b, which is in
    neither model.
    """
    rng = np.random.default_rng(seed)
    sigma = float(IDEAL["cell_sigma"])
    filter = Filter(algorithm, process_sigma=1e-4, rate_process_sigma=RATE_WALK, initial_rate_sigma=0.02)
    draw = rng.normal(size=3)
    sun_b = tuple((draw / np.linalg.norm(draw)).tolist())
    omega = across(0.01 * rng.normal(size=3), sun_b)
    nees, nis, dof = np.empty(STEPS), np.empty(STEPS), np.empty(STEPS)
    for k in range(STEPS):
        omega = across(omega + RATE_WALK * math.sqrt(DT) * rng.normal(size=3), sun_b)
        sun_b = turned(sun_b, tuple(omega.tolist()))
        # noise on lit cells alone, and a dark one stays dark: no cell is chosen for its noise
        light = CORNERS @ sun_b
        voltages = np.where(light > 0.0, np.maximum(light + sigma * rng.normal(size=8), 1e-12), 0.0)
        heading = filter.step(voltages)
        helper = np.eye(3)[np.argmin(np.abs(heading.sun_b))]
        e1 = np.cross(heading.sun_b, helper)
        e1 /= np.linalg.norm(e1)
        tangent = np.stack((e1, np.cross(heading.sun_b, e1)))
        error = tangent @ np.subtract(sun_b, heading.sun_b)
        covariance = tangent @ np.reshape(heading.covariance, (3, 3)) @ tangent.T
        nees[k] = error @ np.linalg.solve(covariance, error)
        nis[k], dof[k] = heading.nis, heading.nis_dof
    return nees[SETTLED:], nis[SETTLED:], dof[SETTLED:]


@BOTH
def test_errors_are_those_that_the_covariance_says(algorithm):
    nees, nis, dof = map(np.array, zip(*(fly_consistent(algorithm, seed) for seed in range(RUNS)), strict=True))
    assert nees.mean() == pytest.approx(2.0, abs=0.15)
    assert nis.sum() / dof.sum() == pytest.approx(1.0, abs=0.03)
    apart = nees[:, ::60].ravel()
    for level in (0.5, 0.9):
        beyond = np.mean(apart > chi2.ppf(level, 2))
        assert abs(beyond - (1.0 - level)) < 4.0 * math.sqrt(level * (1.0 - level) / apart.size), level
