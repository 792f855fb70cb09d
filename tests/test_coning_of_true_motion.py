# SPDX-License-Identifier: Apache-2.0
"""Sun angle, spin and coning from the pulses of a known motion: the paper's numbers, their biases and their aliases."""

import math

import numpy as np
import pytest
from presence import present
from spinning import STEADY, motion_of, record_of, sun_angles, sun_over_andoya

from css_estimation.spin.coning import (
    CHOICE_EVENTS,
    CHOICE_INERTIA,
    CHOICE_ONLY,
    CHOICE_POWER,
    analyse_coning,
    justification,
)
from css_estimation.spin.coning_angle import extremum_differences, fit_sine, max_min_angle
from css_estimation.spin.coning_spectrum import alias_frequencies, fourier_spectrum, peak_frequency, sequence_numbers
from css_estimation.spin.slit_angles import motion_gain
from css_sim.spinning_payload import inertia_ratio

SUN_N = sun_over_andoya()
INCLINATION = math.radians(30.0)
PERIOD = 0.2618


@pytest.fixture(scope="module")
def up_leg():
    """The paper's spin and coning, watched for 119 s as from booms to apogee."""
    return record_of(motion_of(**STEADY), SUN_N, 0.0, 119.0)


@pytest.fixture(scope="module")
def up_leg_coning(up_leg):
    return analyse_coning(up_leg.passages, INCLINATION)


def test_rotation_rate_within_half_a_per_cent_although_coning_modulates_it(up_leg):
    rate = up_leg.passages.rate / (2.0 * math.pi)
    assert np.mean(rate) == pytest.approx(5.45, rel=1e-3)
    assert 1.0 / np.mean(1.0 / rate) == pytest.approx(5.45, rel=1e-4)
    assert 5.3 < rate.min() < 5.36
    assert 5.55 < rate.max() < 5.62


def test_the_fitted_cone_is_the_true_one(up_leg_coning):
    assert math.degrees(up_leg_coning.full_angle) == pytest.approx(12.89, abs=0.01)


def test_the_true_frequency_is_one_of_four_and_the_pulses_tell_which(up_leg_coning):
    found = [candidate.frequency for candidate in up_leg_coning.candidates]
    assert len(found) == 4
    assert found[1] == pytest.approx(1.0 / PERIOD, abs=2e-3)
    assert up_leg_coning.chosen == 1
    assert up_leg_coning.choice == CHOICE_EVENTS
    # to the timer's own resolution, where the others miss by a thousand times that
    assert up_leg_coning.residuals[1] == pytest.approx(1e-6 / math.sqrt(12.0), rel=0.1)
    assert min(r for i, r in enumerate(up_leg_coning.residuals) if i != 1) > 1e-4
    assert "explains the pulses" in justification(up_leg_coning)


def test_power_at_the_true_times_hardly_tells_aliases_apart(up_leg_coning):
    powers = [candidate.power for candidate in up_leg_coning.candidates]
    assert min(powers[:3]) > 0.97


@pytest.mark.parametrize("frequency", [0.8, 1.63, 3.82, 6.25, 7.4])
def test_a_given_inertia_ratio_chooses_the_true_frequency(frequency):
    motion = motion_of(4, **STEADY | {"payload__coning_period": [1.0 / frequency]})
    passages = record_of(motion, SUN_N, 0.0, 60.0).passages
    ratio = inertia_ratio(5.45, 1.0 / frequency, math.radians(6.445))
    coning = analyse_coning(passages, INCLINATION, ratio)
    assert present(coning).choice == CHOICE_INERTIA
    assert len(present(coning).candidates) <= 4
    assert present(coning).frequency == pytest.approx(frequency, abs=5e-3)
    assert present(coning).candidates[present(coning).chosen].inertia_ratio == pytest.approx(ratio, abs=2e-3)
    assert math.degrees(present(coning).full_angle) == pytest.approx(12.89, abs=0.02)


def test_a_ratio_between_two_candidates_leaves_the_choice_to_the_pulses(up_leg):
    passages = up_leg.passages.between(0.0, 40.0)
    coning = analyse_coning(passages, INCLINATION, 1.0)  # aliases are at 0.700 and 1.301
    assert (present(coning).choice, present(coning).chosen, present(coning).rivals) == (CHOICE_EVENTS, 1, ())


def test_what_nothing_tells_apart_is_ambiguous_and_its_rivals_are_named(up_leg, monkeypatch):
    monkeypatch.setattr("css_estimation.spin.coning.fit_motion", lambda *arguments: None)
    passages = up_leg.passages.between(0.0, 40.0)
    near = analyse_coning(passages, INCLINATION, 0.72)
    assert (present(near).choice, present(near).chosen, present(near).rivals) == (CHOICE_INERTIA, 1, ())
    between = analyse_coning(passages, INCLINATION, 1.0)
    assert (present(between).choice, present(between).chosen, present(between).rivals) == (CHOICE_INERTIA, 1, (2,))
    assert "ambiguous, 0.1412 s may as well be: the given ratio of moments" in justification(present(between))
    unknown = analyse_coning(passages, INCLINATION)
    assert present(unknown).choice == CHOICE_POWER
    assert sorted((present(unknown).chosen, *present(unknown).rivals)) == [0, 1, 2, 3]
    powers = [candidate.power for candidate in present(unknown).candidates]
    assert powers[present(unknown).chosen] == max(powers)
    assert "the largest power is no proof; give the ratio" in justification(present(unknown))


def test_the_papers_method_reads_too_little_for_two_reasons_with_numbers(up_leg, up_leg_coning):
    """Motion during the passage flattens the swing of the Sun angle; a sample a turn misses its extrema."""
    passages = up_leg.passages
    true = sun_angles(motion_of(**STEADY), passages.time, SUN_N)
    assert math.degrees(max_min_angle(true)) < 11.9  # perfect Sun angles, sampled once a turn
    in_phase, quadrature = motion_gain(up_leg_coning.sun_angle, INCLINATION, PERIOD**-1 / 5.45)
    flattened = math.hypot(1.0 + in_phase, quadrature)
    assert up_leg_coning.sine.full_angle / math.radians(12.89) == pytest.approx(flattened, abs=0.01)
    both = math.degrees(up_leg_coning.max_min_angle)
    assert 9.9 < both < 11.2
    assert both == pytest.approx(math.degrees(up_leg_coning.sampled_angle), abs=0.2)


def test_the_error_of_the_sun_angle_is_the_predicted_one(up_leg):
    passages = up_leg.passages
    error = passages.angle - sun_angles(motion_of(**STEADY), passages.time, SUN_N)
    assert np.mean(error[40:] ** 2 / up_leg.sigma[40:] ** 2) < 1.0  # unknown ratio: the worst is assumed
    known = record_of(motion_of(**STEADY), SUN_N, 0.0, 60.0)
    p = known.passages
    gain = np.hypot(*motion_gain(float(np.mean(p.angle)), INCLINATION, 0.7))
    swing = sun_angles(motion_of(**STEADY), p.time, SUN_N)
    error = p.angle - swing
    assert np.std(error) == pytest.approx(gain * np.std(swing), rel=0.1)


@pytest.mark.parametrize(("heads", "candidates"), [([0.0], 4), ([0.0, 180.0], 2), ([0.0, 90.0, 180.0, 270.0], 1)])
def test_more_heads_leave_fewer_aliases_and_read_more_of_the_cone(heads, candidates):
    passages = record_of(motion_of(**STEADY), SUN_N, 0.0, 40.0, slits__head_azimuths_deg=heads).passages
    coning = analyse_coning(passages, INCLINATION)
    assert len(present(coning).candidates) == candidates
    assert present(coning).frequency == pytest.approx(1.0 / PERIOD, abs=5e-3)
    assert (present(coning).choice == CHOICE_ONLY) == (candidates == 1)
    assert math.degrees(present(coning).full_angle) == pytest.approx(12.89, abs=0.02)


def test_missing_passages_do_not_shift_the_phase_of_the_rest(up_leg):
    p = up_leg.passages
    keep = np.random.default_rng(1).random(len(p.time)) > 0.05
    time, angle = p.time[keep], p.angle[keep]
    np.testing.assert_array_equal(sequence_numbers(time), np.flatnonzero(keep) - np.flatnonzero(keep)[0])
    base = peak_frequency(fourier_spectrum(time, angle))
    assert base == pytest.approx(5.45 - 1.0 / PERIOD, abs=3e-3)


def test_aliases_of_one_sample_a_turn():
    assert alias_frequencies(1.63, 5.45, 10.9) == pytest.approx([1.63, 3.82, 7.08, 9.27])
    assert alias_frequencies(3.82, 21.8, 10.9) == pytest.approx([3.82])


def test_extrema_and_sinusoid_of_a_dense_series():
    time = np.arange(0.0, 40.0, 0.01)
    angle = 0.4 + 0.001 * time + 0.1 * np.cos(2.0 * np.pi * 0.9 * time + 0.3)
    differences, at = extremum_differences(angle)
    np.testing.assert_allclose(differences, 0.2, atol=1.2e-3)
    np.testing.assert_allclose(np.diff(time[at]), 0.5 / 0.9, atol=0.011)
    sine = fit_sine(time, angle, 0.9)
    assert sine.full_angle == pytest.approx(0.2, abs=1e-12)
    assert (sine.offset, sine.slope) == pytest.approx((0.4, 0.001), abs=1e-12)


def test_motions_are_fitted_over_fifteen_seconds_each(up_leg, monkeypatch):
    """Candidates to the middle of the window; the mean is over all of it, cut into equal parts."""
    spans = []

    def note(pulses, *arguments):
        spans.append((pulses.time.min(), pulses.time.max()))

    monkeypatch.setattr("css_estimation.spin.coning.fit_motion", note)
    passages = up_leg.passages.between(5.0, 65.0)
    coning = analyse_coning(passages, INCLINATION)
    start, end = passages.time[0], passages.time[-1]
    turn = 1.0 / 5.45
    middle = 0.5 * (start + end)
    count = len(present(coning).candidates)
    np.testing.assert_allclose(spans[:count], [(middle - 7.5, middle + 7.5)] * count, atol=1.5 * turn)
    quarters = np.linspace(start, end, 5)
    np.testing.assert_allclose(spans[count:], np.stack((quarters[:-1], quarters[1:]), 1), atol=1.5 * turn)


def test_too_few_passages_give_no_coning(up_leg):
    assert analyse_coning(up_leg.passages.between(0.0, 2.0), INCLINATION) is None
