# SPDX-License-Identifier: Apache-2.0
"""The attitude of a batch: what the gyro counts, and how everything changes with the unknowns, against differences."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from css_calibration.attitude_guess import gyro_noise, integrated
from css_calibration.attitude_track import BIAS, COMMON, COMMON_SIGMA, FIELD_BIAS, Track, turn, turned_by
from css_calibration.errors import CalibrationError

RATE = np.array([0.01, -0.02, 0.03])


def rates(count=601, bias=(0.0, 0.0, 0.0), gap=()):
    stamps = np.arange(count) * 1_000_000_000
    kept = np.array([k not in gap for k in range(count)])
    return SimpleNamespace(
        origin="made up", stamp_ns=stamps, gyro_ns=stamps[kept], gyro_b=np.tile(RATE + np.array(bias), (count, 1))[kept]
    )


def test_a_constant_rate_turns_the_frame_by_its_integral():
    phi, _, stretch = integrated(rates())
    assert (stretch == 0).all()
    # a frame that turns by v has the matrix exp(-[v x])
    expected = Rotation.from_rotvec(-RATE * 600.0).as_matrix()
    assert np.abs(phi[-1] - expected).max() < 1e-9


def test_a_bias_turns_the_rest_as_the_integral_says():
    bias = np.radians([0.002, -0.001, 0.0015])
    phi, integral, _ = integrated(rates(bias=bias))
    true = Rotation.from_rotvec(-RATE[None] * np.arange(601)[:, None]).as_matrix()
    e = phi.transpose(0, 2, 1) @ true
    assert np.abs(turned_by(e)[60] + integral[60] @ bias).max() < 2e-5
    # the sign counts: a bias of the other sign would be twice as far off as there is to explain
    assert np.linalg.norm(turned_by(e)[60]) > 1e-3


def test_a_silent_gyro_ends_a_stretch():
    _, _, stretch = integrated(rates(gap=range(100, 130)))
    assert stretch[99] == 0 and stretch[131] == 1
    assert (stretch[101:129] == -1).all()


def test_without_rates_there_is_no_attitude():
    with pytest.raises(CalibrationError, match="rates of a gyro"):
        integrated(rates(count=30, gap=range(30)))


def test_noise_of_a_gyro_is_that_of_its_samples():
    flown = rates(count=4000)
    flown.gyro_b = flown.gyro_b + np.random.default_rng(3).normal(0.0, 2e-4, flown.gyro_b.shape)
    assert gyro_noise(flown) == pytest.approx(2e-4, rel=0.05)


def track() -> Track:
    rng = np.random.default_rng(4)
    count, knots = 20, 5
    knot = np.repeat(np.arange(knots - 1), count // (knots - 1))
    directions = rng.normal(size=(2, count, 3))
    sun_n, field_n = directions / np.linalg.norm(directions, axis=2, keepdims=True)
    return Track(
        Rotation.random(count, random_state=1).as_matrix(), 10.0 * rng.normal(size=(count, 3, 3)), knot,
        np.tile(np.linspace(0.0, 0.9, count // (knots - 1)), knots - 1), turn(0.05 * rng.normal(size=(knots, 3))),
        10.0 * rng.normal(size=(knots, 3, 3)), np.array([True, True, False, True, False]), np.full(knots, 1e-3),
        sun_n, 3e-5 * field_n, 3e-5 * field_n[::-1], 1e-7,
    )  # fmt: skip


def differences(function, x):
    base = function(x)
    return np.stack([(function(x + 1e-5 * e) - function(x - 1e-5 * e)) / 2e-5 for e in np.eye(len(x))], -1), base


def test_derivatives_of_attitude_links_and_field_are_those_of_differences():
    t = track()
    x = 0.01 * np.random.default_rng(5).normal(size=t.count)
    weights = np.random.default_rng(6).normal(size=(len(t.sun_n), 3))

    def seen(x):
        return np.einsum("ki,kij,kj->k", weights, t.attitudes(x)[0], t.sun_n)

    by, _ = differences(seen, x)
    # rotations between knots are small: the derivatives hold to first order in them
    assert np.abs(by - t.by_unknowns(t.attitudes(x)[1], t.sun_n, weights)).max() < 0.15 * np.abs(by).max()
    by, _ = differences(lambda x: t.links(x)[0], x)
    assert np.abs(by - t.links(x)[1]).max() < 0.1 * np.abs(by).max()
    by, _ = differences(lambda x: t.field(x, *t.attitudes(x))[0], x)
    assert np.abs(by - t.field(x, *t.attitudes(x))[1]).max() < 0.15 * np.abs(by).max()


def test_units_of_the_common_unknowns():
    t = track()
    x = np.zeros(t.count)
    x[FIELD_BIAS.start], x[BIAS.start] = 1.0, -1.0
    assert t.common(x)[3] == pytest.approx(20e-6)
    assert t.common(x)[0] == pytest.approx(-np.radians(0.2))
    assert len(COMMON_SIGMA) == COMMON
