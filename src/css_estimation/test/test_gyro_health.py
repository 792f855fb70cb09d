# SPDX-License-Identifier: Apache-2.0
"""The gyro against its own samples and the Sun line: every kind of fault is found and named, a good one never is."""

import numpy as np
import pytest
from sensor_truth import DEG, Judged, parameters, seen, tumble

from css_common.actuator_sections import WHEELS
from css_common.declared import built, table_of
from css_common.health import (
    KIND_BIAS,
    KIND_DEAD,
    KIND_FROZEN,
    KIND_INTERMITTENT,
    KIND_NOISY,
    KIND_SCALED,
    KIND_SIGN,
    KIND_SILENT,
    KIND_SPIKES,
    KIND_STUCK,
)
from css_common.schema import default_values
from css_common.sections import SPACECRAFT
from css_estimation.health.gyro_state import GYRO_CORRECTED, GYRO_LEFT, GYRO_TRUSTED, unseen_sigma
from css_estimation.health.rate_checks import RateChecks
from css_estimation.sun.sun_heading import LEFT_GYRO

P = parameters()
CHECKS = table_of(RateChecks)
DT, COUNT = 0.1, 6000
SIGHT = 0.5 * DEG
NOISE = 0.01 * DEG
RATES = [(3.0, -2.0, 4.0), (0.5, 5.0, -1.0), (-1.0, 1.0, 2.0)]


def flight(rate, seed=1, count=COUNT):
    """Rates, gyro and sights of a tumble."""
    dice = np.random.default_rng(seed)
    omega, attitudes = tumble(rate, count, DT)
    gyro = omega + NOISE * dice.normal(size=omega.shape) + dice.normal(size=3) * DEG / 3600.0
    return omega, gyro, seen(attitudes, dice, SIGHT), dice


def judged(gyro, sun, **changes):
    return Judged(P, DT, gyro=gyro, sun=sun, sigma=SIGHT, **changes)


def spoilt(gyro, axis, fault, from_s=60.0):
    """A gyro with a fault of one axis from a time on: what it makes of readings and times since."""
    gyro, first = gyro.copy(), round(from_s / DT)
    gyro[first:, axis] = fault(gyro[first:, axis], DT * np.arange(len(gyro) - first))
    return gyro


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("seed", range(3))
def test_a_good_gyro_is_given_on_untouched(rate, seed):
    _, gyro, sun, _ = flight(rate, seed, 2 * COUNT)
    result = judged(gyro, sun)
    assert np.array_equal(result.rate_b, gyro)
    assert result.gyro_valid.all()
    assert not result.left.any() and not result.gyro_held.any()
    assert not result.gyro_kinds


@pytest.mark.parametrize("rate", [(0.0, 0.0, 0.6), (0.0, 0.0, 0.0)])
def test_nor_is_that_of_a_body_that_hardly_turns(rate):
    _, gyro, sun, _ = flight(rate, count=2 * COUNT)
    result = judged(gyro, sun)
    assert np.array_equal(result.rate_b, gyro)
    assert not result.left.any()


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("size", [1.0, -1.0, 5.0])
@pytest.mark.parametrize("axis", range(3))
def test_a_bias_from_the_beginning_is_found_by_the_sun_and_taken_off(rate, size, axis):
    omega, gyro, sun, _ = flight(rate)
    gyro[:, axis] += size * DEG
    result = judged(gyro, sun)
    assert result.mode[-1] == GYRO_CORRECTED
    assert result.gyro_kinds == {axis: KIND_BIAS}
    # it is told with the estimate too
    assert np.array_equal(result.gyro_held, result.mode != GYRO_TRUSTED)
    # sigma of the filter, for all that a sight's error of a time and not of a sample is reckoned with
    assert np.all(np.abs(result.bias_b[-1] - size * DEG * np.eye(3)[axis]) < 3.0 * np.sqrt(result.variances[-1]))
    assert np.mean(np.linalg.norm(result.rate_b - omega, axis=1)[-1000:]) < 0.1 * DEG


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("size", [1.0, -5.0])
def test_a_step_is_taken_off_at_once_also_where_the_sun_does_not_tell(axis, size):
    # a body at rest, the Sun in the dark
    _, gyro, sun, _ = flight((0.0, 0.0, 0.0), count=2000)
    result = judged(spoilt(gyro, axis, lambda x, t: x + size * DEG), sun, known=np.zeros(2000, bool))
    assert result.mode[605] == GYRO_CORRECTED
    assert result.gyro_kinds == {axis: KIND_BIAS}
    assert np.abs(result.rate_b).max() < 0.3 * DEG


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("axis", range(3))
def test_a_wrong_sign_is_left_and_not_used_again(rate, axis):
    _, gyro, sun, _ = flight(rate)
    result = judged(spoilt(gyro, axis, lambda x, t: -x, 0.0), sun)
    assert result.mode[-1] == GYRO_LEFT
    assert result.gyro_kinds == {axis: KIND_SIGN}
    assert result.left[-1] == LEFT_GYRO
    assert not result.gyro_valid[-1]


def test_a_sign_that_is_mended_is_used_again():
    _, gyro, sun, _ = flight(RATES[0], count=2 * COUNT)
    first = COUNT // 2
    gyro[first : 2 * first, 0] *= -1.0
    result = judged(gyro, sun)
    assert result.mode[2 * first - 1] == GYRO_LEFT
    assert result.mode[-1] == GYRO_TRUSTED
    assert not result.gyro_kinds


def test_a_scale_is_left():
    _, gyro, sun, _ = flight(RATES[1])
    result = judged(spoilt(gyro, 1, lambda x, t: 2.0 * x, 0.0), sun)
    assert result.mode[-1] == GYRO_LEFT
    assert result.gyro_kinds == {1: KIND_SCALED}


@pytest.mark.parametrize(
    ("fault", "kind"),
    [
        (lambda x, t: 0.0 * x, KIND_DEAD),
        (lambda x, t: 0.0 * x + 7.0 * DEG, KIND_STUCK),
        (lambda x, t: 0.0 * x + x[0], KIND_FROZEN),
        (lambda x, t: x + 2.0 * DEG * np.random.default_rng(9).normal(size=len(x)), KIND_NOISY),
    ],
)
@pytest.mark.parametrize("axis", range(3))
def test_samples_that_cannot_be_are_found_within_seconds(fault, kind, axis):
    _, gyro, sun, _ = flight(RATES[0])
    result = judged(spoilt(gyro, axis, fault), sun)
    assert result.mode[600 + 30] == GYRO_LEFT
    assert result.mode[-1] == GYRO_LEFT
    assert result.gyro_kinds == {axis: kind}


def test_a_gyro_without_noise_may_read_the_same_for_ever():
    _, _, sun, _ = flight((0.0, 0.0, 0.0), count=600)
    result = judged(np.zeros((600, 3)), sun)
    assert not result.left.any()


def test_spells_of_zeros_are_an_intermittent_axis():
    _, gyro, sun, _ = flight(RATES[0], count=2 * COUNT)
    for first in (1000, 4000):
        gyro[first : first + 300, 1] = 0.0
    result = judged(gyro[:4200], sun[:4200])
    assert result.gyro_kinds == {1: KIND_INTERMITTENT}


def test_spikes_are_dropped_and_nothing_else():
    _, gyro, sun, dice = flight(RATES[0])
    hit = dice.random(COUNT) < 0.03
    hit[:2] = False
    hit[1:] &= ~hit[:-1]
    spiky = gyro.copy()
    spiky[hit, 2] += 10.0 * DEG
    result = judged(spiky, sun)
    assert hit.sum() > 100
    assert not result.left.any()
    np.testing.assert_array_equal(result.rate_b[~hit], gyro[~hit])
    # the last good value stands in, of the axis that was hit alone
    np.testing.assert_array_equal(result.rate_b[hit, 2], gyro[np.flatnonzero(hit) - 1, 2])
    np.testing.assert_array_equal(result.rate_b[hit, :2], gyro[hit, :2])


@pytest.mark.parametrize(
    ("squared", "kind"), [(0.5, KIND_SPIKES), (1.0, KIND_SPIKES), (3.0, KIND_NOISY), (6.0, KIND_NOISY)]
)
@pytest.mark.parametrize("seed", range(3))
def test_too_many_spikes_are_noise_where_the_samples_between_are_no_better(squared, kind, seed):
    """Twice the mean squared change of the noise that is expected, 0.03 deg/s, is where one ends."""
    omega, _, sun, _ = flight(RATES[0], seed)
    dice = np.random.default_rng(seed)
    gyro = omega + np.sqrt(squared) * 0.03 * DEG * dice.normal(size=omega.shape)
    gyro[600:, 1] += 20.0 * DEG * dice.choice((-1.0, 0.0, 1.0), COUNT - 600, p=(0.2, 0.6, 0.2))
    result = judged(gyro, sun)
    assert result.mode[-1] == GYRO_LEFT
    assert result.gyro_kinds == {1: kind}


def test_no_number_is_replaced_for_a_second_then_the_gyro_is_left():
    _, gyro, sun, _ = flight(RATES[0], count=300)
    gyro[100:105, 0] = np.nan
    gyro[200:, 0] = np.nan
    result = judged(gyro, sun)
    assert np.isfinite(result.rate_b).all()
    assert not result.left[:205].any()
    assert result.left[215:].all()


def test_silence_is_told_and_the_gyro_used_again():
    _, gyro, sun, _ = flight(RATES[0], count=1500)
    valid = np.ones(1500, bool)
    valid[500:600] = False
    result = judged(gyro[:600], sun[:600], gyro_valid=valid[:600])
    assert result.gyro_kinds == dict.fromkeys(range(3), KIND_SILENT)
    assert not result.gyro_valid[500:600].any()
    whole = judged(gyro, sun, gyro_valid=valid)
    assert whole.mode[-1] == GYRO_TRUSTED
    assert not whole.gyro_kinds


def test_in_the_dark_nothing_is_judged_and_verdicts_stand():
    _, gyro, sun, _ = flight(RATES[0], count=2 * COUNT)
    gyro[:, 0] += DEG
    known = np.ones(2 * COUNT, bool)
    known[COUNT:] = False
    result = judged(gyro, sun, known=known)
    assert (result.mode[COUNT:] == GYRO_CORRECTED).all()
    np.testing.assert_array_equal(result.bias_b[COUNT + 30 :], result.bias_b[[COUNT + 30]].repeat(COUNT - 30, axis=0))


def test_without_cells_that_contradict_it_a_gyro_is_not_accused():
    _, gyro, sun, _ = flight(RATES[0])
    gyro[:, 0] += DEG
    result = judged(gyro, sun, misfits=False)
    assert (result.mode == GYRO_TRUSTED).all()
    assert np.array_equal(result.rate_b, gyro)


def test_along_a_sun_line_at_rest_in_the_body_nothing_is_known():
    # it turns about the Sun line: z of a body that looks there
    dice = np.random.default_rng(4)
    omega = np.tile([0.0, 0.0, 0.5 * DEG], (3000, 1))
    sun = np.tile([0.0, 0.0, 1.0], (3000, 1)) + SIGHT * dice.normal(size=(3000, 3))
    sun /= np.linalg.norm(sun, axis=1)[:, None]
    gyro = omega + NOISE * dice.normal(size=omega.shape)
    gyro[:, 0] += DEG
    result = judged(gyro, sun)
    assert result.mode[-1] == GYRO_CORRECTED
    known = unseen_sigma(result.state.gyro, (1.0, 0.0, 0.0))
    assert known < 0.2 * DEG
    assert unseen_sigma(result.state.gyro, (0.0, 0.0, 1.0)) > 10.0 * known
    # and so less is said of the rate there than the gyro reads
    assert abs(result.rate_b[-1, 2]) < abs(gyro[-1, 2])


def test_a_gyro_that_nobody_listens_to_is_not_judged():
    """Not by its samples either, which without a time between them seemed to change faster than a body can."""
    _, gyro, sun, _ = flight((3.0, -2.0, 4.0))
    ramp = np.clip(DT * np.arange(COUNT) - 10.0, 0.0, 20.0)[:, np.newaxis]
    lying = spoilt(gyro + 2.0 * DEG * ramp, 1, lambda x, t: -x, 100.0)
    result = judged(lying, sun, used=np.zeros(COUNT, bool))
    assert not result.left.any() and not result.gyro_held.any()
    assert np.array_equal(result.rate_b, lying) and result.gyro_valid.all()


def test_a_gyro_that_is_used_again_begins_with_its_first_word():
    """What it said meanwhile is no jump, and its silence none."""
    _, gyro, sun, _ = flight((3.0, -2.0, 4.0))
    used = np.ones(COUNT, bool)
    used[1000:4000] = False
    gyro[1000:3990] += 50.0 * DEG
    spoken = np.ones(COUNT, bool)
    spoken[2000:3900] = False
    result = judged(gyro, sun, used=used, gyro_valid=spoken)
    assert not result.left.any() and not result.gyro_held.any()
    assert np.array_equal(result.rate_b[4000:], gyro[4000:])


def test_wheels_may_turn_a_small_body_up_by_as_much_as_they_can():
    """Three of 1 mN m and a smallest moment of 0.005 kg m^2: 11.5 deg/s^2."""
    given = {
        "spacecraft__inertia": np.diag([0.02, 0.02, 0.005]).ravel().tolist(),
        "wheels__axes": np.eye(3).ravel().tolist(),
        "wheels__max_torque": 0.001,
    }
    values = default_values(SPACECRAFT + WHEELS + CHECKS, **given)
    assert built(RateChecks, values).acceleration == pytest.approx(0.2, rel=1e-12)
    assert built(RateChecks, default_values(CHECKS)).acceleration == pytest.approx(DEG)
    bare = default_values(SPACECRAFT + WHEELS + CHECKS, **given, wheels__fitted=False)
    assert built(RateChecks, bare).acceleration == pytest.approx(DEG)
