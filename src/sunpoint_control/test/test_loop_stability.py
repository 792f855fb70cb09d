# SPDX-License-Identifier: Apache-2.0
"""The sampled loop's modes against closed forms, and the gains that the checks before a flight let pass."""

import math

import numpy as np
import pytest

from css_common.component import Smoothing
from sunpoint_control.loop_stability import Gains, LoopModel, fastest_growth, gain_findings, transition

INERTIA = np.diag([10.5, 8.0, 6.75])
AXIS = np.array([0.0, 0.0, 1.0])


def model(**changes):
    plain = LoopModel(INERTIA, AXIS, np.eye(3), 0.1, Smoothing(), gyro=True, late=False)
    return plain._replace(**changes)


def texts(loop, gains):
    return [(finding.refused, finding.text) for finding in gain_findings(loop, gains, "here")]


@pytest.mark.parametrize(("late", "most"), [(False, 2.0), (True, 1.0)])
def test_rate_damping_held_over_a_cycle_bears_twice_the_inertia_over_the_period(late, most):
    # z - 1 + b = 0 with b = P h / I, and z^2 - z + b = 0 with one cycle of delay
    largest = most * 6.75 / 0.1
    assert fastest_growth(model(late=late), Gains(0.0, 0.999 * largest, 0.0)) <= 1.0 + 1e-9
    growth = fastest_growth(model(late=late), Gains(0.0, 1.01 * largest, 0.0))
    assert growth == pytest.approx(math.sqrt(1.01) if late else 1.02, rel=1e-9)


def test_a_low_pass_on_the_rate_moves_the_limit():
    # f' = f + g (w' - f), w' = w - b f: stable below b = (4 - 2 g) / g
    g = 0.06
    largest = (4.0 - 2.0 * g) / g * 6.75 / 0.1
    loop = model(smoothing=Smoothing(rate=g))
    assert fastest_growth(loop, Gains(0.0, 0.999 * largest, 0.0)) <= 1.0 + 1e-9
    assert fastest_growth(loop, Gains(0.0, 1.001 * largest, 0.0)) > 1.0 + 1e-5


def test_attitude_without_rate_feedback_swings_up_by_the_held_torque():
    # theta'' = -a theta held over h has a determinant of 1 + a h^2 / 2
    k = 0.4
    growth = fastest_growth(model(), Gains(k, 0.0, 0.0))
    assert growth == pytest.approx(math.sqrt(1.0 + k / 4.0 / 8.0 * 0.1**2 / 2.0), rel=1e-9)


def test_damped_modes_are_those_of_the_continuous_loop_at_a_short_period():
    # I th'' + P th' + K/4 th = 0 of each axis across the array normal, I w' + P w = 0 about it
    k, p, h = 0.148, 0.9, 1e-3
    values = np.linalg.eigvals(transition(model(period=h), Gains(k, p, 0.0)))
    expected = [-p / 6.75, *(root for i in (10.5, 8.0) for root in np.roots([i, p, k / 4.0]))]
    moving = np.log(values[np.abs(values) > 0.5].astype(complex)) / h
    for root in expected:
        assert np.min(np.abs(moving - root)) < 1e-4


def test_the_sign_of_the_feedback_matters():
    assert fastest_growth(model(), Gains(-0.148, 0.9, 0.0)) > 1.0 + 1e-4
    assert fastest_growth(model(), Gains(0.0, -0.9, 0.0)) > 1.0 + 1e-4


def test_modes_do_not_hang_on_the_axes():
    turn = np.linalg.qr(np.array([[1.0, 2.0, 0.5], [0.3, -1.0, 1.0], [2.0, 0.1, 1.0]]))[0]
    turned = model(inertia=turn @ INERTIA @ turn.T, array_normal_b=turn @ AXIS)
    for gains in (Gains(0.148, 0.9, 1e-4), Gains(20.0, 40.0, 1e-3)):
        assert fastest_growth(turned, gains) == pytest.approx(fastest_growth(model(), gains), rel=1e-9)


@pytest.mark.parametrize(
    ("gains", "words"),
    [
        (Gains(0.148, 136.0, 0.0), "gains.p: 136 given, expected at most 13"),
        (Gains(0.148, 0.0, 0.0), "gains.p: 0 given, expected at least 0.00"),
        (Gains(100.0, 1.0, 0.0), "gains.k: 100 given, expected at most 80 "),
        (Gains(1e4, 60.0, 0.0), "gains.k: 10000 given, expected at most"),
        (Gains(0.148, 0.9, 1e5), "gains.ki: 100000 given, expected at most"),
        (Gains(1e308, 0.9, 0.0), "gains.k: 1e+308 given, expected at most"),
        (Gains(0.148, 1.7e308, 0.0), "gains.p: 1.7e+308 given, expected at most"),
        (Gains(0.148, 0.9, 1e308), "gains.ki: 1e+308 given, expected at most"),
    ],
)
def test_gains_that_cannot_be_stable_are_refused_with_those_that_can(gains, words):
    ((refused, text),) = texts(model(), gains)
    assert refused and text.startswith(words) and "grows tenfold in" in text
    key = text.removeprefix("gains.").partition(":")[0]
    limit = float(text.split("expected at ")[1].split()[1])
    assert fastest_growth(model(), gains._replace(**{key: limit})) <= 1.0 + 1e-6


def test_little_margin_is_worth_a_warning_and_enough_is_not():
    ((refused, text),) = texts(model(), Gains(0.148, 80.0, 0.0))
    assert not refused and "6 dB" in text and "at most 13" in text
    assert texts(model(), Gains(0.148, 60.0, 0.0)) == []
    assert texts(model(), Gains(0.0, 0.0, 0.0)) == []


def test_a_filter_without_gyro_bears_less():
    slow = model(gyro=False, smoothing=Smoothing(rate=0.06, heading=0.031))
    assert texts(slow, Gains(0.148, 0.9, 0.0)) == []
    assert [refused for refused, _ in texts(slow, Gains(0.148, 8.0, 0.0))] == [True]
    assert texts(model(gyro=False), Gains(0.148, 8.0, 0.0)) == []
