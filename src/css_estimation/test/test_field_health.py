# SPDX-License-Identifier: Apache-2.0
"""The magnetometer by its samples and by what no turn of the body changes."""

import numpy as np
import pytest
from sensor_truth import DEG, SUN_N, Judged, dipole, parameters, seen, tumble

from css_common.health import KIND_DEAD, KIND_FROZEN, SORT_MAGNETOMETER, new_verdicts
from css_estimation.health import field_health
from css_estimation.health.field_health import check_field
from css_estimation.health.gyroless_sight import glimpse_of
from css_estimation.health.rate_checks import new_axes
from css_estimation.health.sight import Sight
from css_estimation.health.slow_value import NOTHING_YET, follow, passed
from css_estimation.sun.sun_heading import LEFT_FIELD, PREDICTION_SUNLIT, UNKNOWN_SKY, Sky

P = parameters()
DT, COUNT = 0.5, 4000
SIGHT = 2.0 * DEG
FROM = 600
RATES = [(3.0, -2.0, 4.0), (-1.0, 1.0, 2.0)]


def flight(rate=RATES[0], seed=1, bias=500e-9):
    """Field as a good magnetometer of a small satellite reads it, and sights."""
    dice = np.random.default_rng(seed)
    _, attitudes = tumble(rate, COUNT, DT)
    field, _ = dipole(attitudes, DT)
    field = field + 100e-9 * dice.normal(size=field.shape) + bias * dice.normal(size=3)
    return np.round(field / 30e-9) * 30e-9, seen(attitudes, dice, SIGHT), dice


def judged(field, sun):
    return Judged(P, DT, field=field, sun=sun, sigma=SIGHT)


def spoilt(field, axis, fault):
    field = field.copy()
    field[FROM:, axis] = fault(field[FROM:, axis])
    return field


@pytest.mark.parametrize("rate", [*RATES, (0.0, 0.0, 0.1), (8.0, 0.0, 0.0)])
@pytest.mark.parametrize("seed", range(3))
def test_a_good_magnetometer_is_given_on_untouched(rate, seed):
    field, sun, _ = flight(rate, seed)
    result = judged(field, sun)
    assert not result.left.any()
    assert result.field_valid.all()
    assert not result.field_kinds


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize(
    "fault",
    [lambda x: -x, lambda x: 2.0 * x, lambda x: x + 10e-6, lambda x: 0.0 * x, lambda x: 0.0 * x + x[0]],
    ids=["sign", "scaled", "bias", "dead", "frozen"],
)
@pytest.mark.parametrize("rate", RATES)
def test_one_that_fails_is_left_within_a_turn(axis, fault, rate):
    field, sun, _ = flight(rate)
    result = judged(spoilt(field, axis, fault), sun)
    assert not result.left[:FROM].any()
    turn = round(360.0 / np.linalg.norm(rate) / DT)
    assert LEFT_FIELD in result.left[FROM : FROM + turn]
    assert not result.field_valid[result.left == LEFT_FIELD].any()


def test_an_axis_that_never_changes_is_named():
    field, sun, _ = flight()
    assert judged(spoilt(field, 1, lambda x: 0.0 * x), sun).field_kinds[1] == KIND_DEAD
    assert judged(spoilt(field, 2, lambda x: 0.0 * x + x[0]), sun).field_kinds[2] == KIND_FROZEN


def test_one_that_is_mended_is_used_again():
    field, sun, _ = flight()
    failing = field.copy()
    failing[FROM : FROM + 100, 0] *= 2.0
    result = judged(failing, sun)
    assert result.left[FROM + 99] == LEFT_FIELD
    assert not result.left[-1]
    assert result.field_valid[-1]
    assert not result.field_kinds


def test_a_spike_is_as_if_no_reading_had_come():
    field, sun, _ = flight()
    hit = np.zeros(COUNT, bool)
    hit[100::37] = True
    spiky = field.copy()
    spiky[hit, 1] += 60e-6
    result = judged(spiky, sun)
    assert not result.left.any()
    np.testing.assert_array_equal(result.field_valid, ~hit)


def against(field_n, field_b, sun_b, count=20):
    """Whether a magnetometer is left that reads so for 10 s, the model's field known."""
    p = P.field
    state, axes, verdicts = field_health.initial_state(p), new_axes(), new_verdicts(SORT_MAGNETOMETER, 3)
    sky = Sky(True, PREDICTION_SUNLIT, tuple(SUN_N), 1.0, 1.0, (7e6, 0.0, 0.0), field_n, UNKNOWN_SKY.light)
    sight = glimpse_of(Sight(tuple(sun_b), SIGHT**2, True))
    dice = np.random.default_rng(1)
    for k in range(count):
        reading = tuple(np.array(field_b) + 100e-9 * dice.normal(size=3))
        state, _, _, left = check_field(p, state, axes, verdicts, DT, k, reading, True, sky, sight)
    return left


def test_where_the_model_is_known_a_body_at_rest_is_enough():
    field_n = (2e-5, -1e-5, 2.5e-5)
    assert not against(field_n, field_n, SUN_N)
    # strength
    assert against(field_n, (3e-5, -1e-5, 2.5e-5), SUN_N)
    # wrong signs keep the strength, but not the angle to the Sun
    assert against(field_n, tuple(-np.array(field_n)), SUN_N)


def test_a_slow_value_is_followed_within_its_variance():
    rate, motion, sigma = 6e-8, 1.1e-3, 1e-6
    dice = np.random.default_rng(6)
    nis, off = [], []
    for _ in range(60):
        phase = 2.0 * np.pi * dice.random()
        slow = NOTHING_YET
        for k in range(400):
            true = 3e-5 + rate / motion * np.sin(motion * k + phase)
            slow = follow(passed(slow, 1.0, rate, motion), true + sigma * dice.normal(), sigma**2, rate)
        nis.append(slow.nis)
        off.append((slow.value - true) / np.sqrt(slow.p))
    assert 0.7 < np.mean(nis) < 1.3
    assert np.sqrt(np.mean(np.square(off))) < 1.3
