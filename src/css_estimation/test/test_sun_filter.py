# SPDX-License-Identifier: Apache-2.0
"""The Sun filter on layouts, in dusk and dark, with broken cells, and whether its error bars are true."""

import math
import re
from functools import partial

import numpy as np
import pytest
from cell_layouts import LAYOUTS
from okeefe_spacecraft import okeefe_values
from sun_filter_flight import SunFilterFlight

from css_common.attitude import rotation_vector_to_dcm
from css_common.vectors import matmul, unit
from css_estimation.nodes.sun_filter import SunFilter
from css_estimation.sun.sun_heading import (
    RATE_GYRO,
    RATE_MOMENTUM,
    RATE_SUN,
    UNAIDED,
    VALIDITY_HELD,
    VALIDITY_VALID,
)
from css_estimation.sun_filter import filter_state, sun_filter
from css_estimation.sun_filter.cell_model import rising
from css_estimation.sun_filter.cell_update import read_above
from css_estimation.sun_filter.response import respond

SIX = LAYOUTS["six faces"]
TURNING = (0.004, -0.003, 0.002)
# the Earth disturbs nothing here: its error bars would hide what is tested
EXACT = {
    "noise": 0.02,
    "common_noise": 0.0,
    "scale_sigma": 0.0,
    "gain_sigma": 0.0,
    "tilt_sigma_deg": 0.0,
}
NO_EARTH = {"albedo__unknown": 0.0, "albedo__unknown_heading_deg": 0.0}


def directions(count):
    dice = np.random.default_rng(7).normal(size=(count, 3))
    return [unit(tuple(d)) for d in dice]


def sees_three_axes(flight):
    """Whether the cells that are lit look along three independent directions."""
    cells = flight.p.cells[flight.voltages() > 0.35]
    normals = np.column_stack([cells["nx"], cells["ny"], cells["nz"]])
    return len(cells) >= 3 and np.linalg.svd(normals)[1][2] > 0.3


@pytest.mark.parametrize("gyro", [True, False], ids=["gyro", "no gyro"])
def test_six_faces_at_rest_find_a_sun_that_lights_three(gyro):
    """A gate relative to the brightest drops the two dim ones and stays 26 deg off."""
    flight = SunFilterFlight(unit((0.3, 0.316, 0.9)), **SIX, **NO_EARTH)
    heading = flight.fly(30.0, gyro=gyro)
    assert heading.validity == VALIDITY_VALID
    assert flight.error_deg(heading) < 0.05


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_sun_is_found_from_anywhere_that_three_cells_see(layout):
    found = 0
    for seed, sun_b in enumerate(directions(25)):
        flight = SunFilterFlight(sun_b, TURNING, seed, white=0.005, **LAYOUTS[layout], **NO_EARTH)
        if sees_three_axes(flight):
            assert flight.error_deg(flight.fly(60.0)) < 1.0
            found += 1
    assert found > 0 or layout == "four coplanar"


@pytest.mark.parametrize("layout", ["dual pyramid", "six faces", "Clark's fourteen"])
def test_an_earth_that_is_known_disturbs_less_and_one_that_is_not_is_within_the_error_bar(layout, monkeypatch):
    errors = []
    for known in (True, False):
        flight = SunFilterFlight(unit((0.2, 0.3, 0.93)), TURNING, white=0.005, earth=(0.3, 0.9, 0.2), **LAYOUTS[layout])
        if not known:
            flight.sky = flight.sky._replace(known=False)
            monkeypatch.setattr(flight, "voltages", partial(_with_earth, flight, flight.voltages))
        heading = flight.fly(400.0, gyro=True)
        errors.append(flight.error_deg(heading))
    assert heading.mode == filter_state.MODE_NO_EARTH
    sigma_deg = math.degrees(math.sqrt(np.trace(np.reshape(heading.covariance, (3, 3))) / 2.0))
    assert sigma_deg > 1.0 and errors[1] < 3.0 * sigma_deg
    assert errors[0] < 0.7


def _with_earth(flight, voltages, part=1.0):
    flight.sky = flight.sky._replace(known=True)
    outputs = voltages(part)
    flight.sky = flight.sky._replace(known=False)
    return outputs


@pytest.mark.parametrize("reading", [0.5, 1.0, 1.4, 3.0, 16.0, -2.0, math.nan, math.inf, 1e300])
def test_one_broken_cell_on_the_dark_side_is_refused(reading):
    flight = SunFilterFlight(unit((0.1, 0.2, 0.97)), TURNING, white=0.002, **NO_EARTH)
    flight.fly(20.0)

    def broken(voltages):
        voltages[6] = reading

    worst = 0.0
    for _ in range(300):
        heading = flight.step(change=broken)
        worst = max(worst, flight.error_deg(heading))
        assert not heading.lit_mask >> 6 & 1
    assert heading.validity == VALIDITY_VALID
    assert worst < 1.0


def test_one_cell_broken_from_the_start_does_not_hide_the_sun():
    flight = SunFilterFlight(unit((0.1, 0.2, 0.97)), TURNING, white=0.002, **NO_EARTH)

    def broken(voltages):
        voltages[6] = 0.5

    assert flight.error_deg(flight.fly(60.0, change=broken)) < 1.0


@pytest.mark.parametrize("known", [True, False], ids=["orbit", "no orbit"])
def test_dusk_is_no_turn(known):
    """Outputs that fade together leave direction and rate alone; the dark then holds them by angular momentum."""
    errors, normalised, dawn = [], [], []
    for seed in range(4):
        flight = SunFilterFlight(unit((0.2, 0.3, 0.93)), TURNING, seed, white=0.002, **NO_EARTH)
        if known:
            flight.sky = flight.sky._replace(known=True, sun_n=flight.sun_n)
        before = worst = flight.error_deg(flight.fly(200.0))
        for part in np.linspace(1.0, 0.0, 82):
            heading = flight.step(part=float(part))
            worst = max(worst, flight.error_deg(heading))
        heading = flight.fly(600.0, part=0.0)
        assert worst < before + (0.02 if known else 0.3)
        assert (heading.validity, heading.mode) == (VALIDITY_HELD, filter_state.MODE_COASTING)
        assert heading.rate_source == RATE_MOMENTUM
        errors.append(flight.error_deg(heading))
        normalised.append(np.radians(errors[-1]) ** 2 / sum(heading.covariance[::4]))
        assert np.degrees(np.linalg.norm(np.subtract(heading.omega_bn_b, flight.omega))) < 0.01
        heading = flight.fly(60.0)
        assert heading.validity == VALIDITY_VALID
        # one cell is lit here, which says nothing of one of the two angles
        dawn.append(flight.error_deg(heading))
    # the orbit says when the penumbra begins; without it the first tenth of the fading is taken for a turn
    assert np.mean(errors) < (1.0 if known else 3.0)
    assert np.mean(normalised) < 1.5
    assert np.mean(dawn) < 0.5


@pytest.mark.parametrize("gyro", [True, False], ids=["gyro", "no gyro"])
def test_dusk_before_its_time_is_no_turn(gyro):
    """A place that is 90 km wrong makes the model 12 s late."""
    for seed in range(3):
        flight = SunFilterFlight(unit((0.2, 0.3, 0.93)), TURNING, seed, white=0.002, earth=(0.3, 0.9, 0.2))
        flight.fly(200.0, gyro=gyro)
        assert flight.error_deg(flight.step(gyro=gyro)) < 0.6
        for part in np.concatenate([np.linspace(1.0, 0.0, 82), np.zeros(40)]):
            heading = flight.step(part=float(part), predicted=1.0, gyro=gyro)
        assert heading.validity == VALIDITY_HELD
        assert flight.error_deg(heading) < 1.0
        heading = flight.fly(60.0, part=0.0, gyro=gyro)
        for part in np.linspace(0.0, 1.0, 82):
            heading = flight.step(part=float(part), predicted=1.0, gyro=gyro)
        assert flight.error_deg(heading) < 1.0
        assert flight.error_deg(flight.fly(30.0, gyro=gyro)) < 0.5


@pytest.mark.parametrize("gyro", [True, False], ids=["gyro", "no gyro"])
def test_the_sun_on_other_cells_is_none_that_sets(gyro):
    flight = SunFilterFlight(unit((0.2, 0.3, 0.93)), TURNING, white=0.002, **NO_EARTH)
    flight.fly(100.0, gyro=gyro)
    flight.dcm_bn = matmul(rotation_vector_to_dcm((2.5, 0.0, 0.0)), flight.dcm_bn)
    assert flight.error_deg(flight.fly(30.0, gyro=gyro)) < 3.0


def test_in_the_dark_a_change_of_the_wheels_is_a_change_of_the_rate():
    flight = SunFilterFlight(unit((0.2, 0.3, 0.93)), TURNING, white=0.002, **NO_EARTH)
    flight.fly(200.0)
    for _ in range(100):
        flight.wheels_b = flight.wheels_b + np.array([2e-4, -1e-4, 3e-4])
        heading = flight.step(part=0.0)
    assert np.degrees(np.linalg.norm(np.subtract(heading.omega_bn_b, flight.omega))) < 0.01
    assert np.degrees(np.linalg.norm(flight.omega)) > 0.15
    heading = flight.fly(100.0, part=0.0)
    assert flight.error_deg(heading) < 1.0


def test_without_gyro_and_wheels_the_dark_is_not_said_to_be_known():
    flight = SunFilterFlight(unit((0.2, 0.3, 0.93)), TURNING, white=0.002, **NO_EARTH)
    flight.fly(200.0, wheels=False)
    heading = flight.fly(20.0, part=0.0, wheels=False)
    sigma_deg = math.degrees(math.sqrt(np.trace(np.reshape(heading.covariance, (3, 3))) / 2.0))
    assert sigma_deg > 3.0 and flight.error_deg(heading) < 3.0 * sigma_deg
    assert heading.rate_source == RATE_SUN


def test_a_gyro_takes_over_and_gives_back():
    flight = SunFilterFlight(unit((0.2, 0.3, 0.93)), TURNING, white=0.002, **NO_EARTH)
    assert flight.fly(100.0).rate_source == RATE_MOMENTUM
    for gyro, source in ((True, RATE_GYRO), (False, RATE_MOMENTUM)):
        heading = flight.fly(60.0, gyro=gyro)
        assert heading.rate_source == source
        assert flight.error_deg(heading) < 0.2


def test_another_intensity_is_learnt():
    flight = SunFilterFlight(unit((0.2, 0.3, 0.93)), TURNING, white=0.002, **NO_EARTH)
    flight.fly(60.0)

    def aged(voltages):
        voltages *= 0.7

    heading = flight.fly(200.0, change=aged)
    assert heading.validity == VALIDITY_VALID
    assert flight.error_deg(heading) < 0.3


@pytest.mark.parametrize("broken", [-1.0, np.nan, np.inf])
def test_a_covariance_that_is_none_ends_the_estimate_and_not_the_filter(broken):
    flight = SunFilterFlight(unit((0.2, 0.3, 0.93)), TURNING, white=0.005, earth=(0.3, 0.9, 0.2))
    flight.fly(60.0)
    states = flight.memory.covariances.shape[1]
    flight.memory.covariances[:] = np.where(np.eye(states) > 0.0, broken, 0.0)
    for _ in range(20):
        heading = flight.step()
        assert np.isfinite([*heading.sun_b, *heading.covariance, *heading.omega_bn_b]).all()
        assert np.linalg.norm(heading.sun_b) == pytest.approx(1.0)
        assert sum(heading.covariance[::4]) > 0.0
    # two cells are lit now, and which of the two Suns it is tells a third one, 80 s later
    heading = flight.fly(100.0)
    assert heading.validity == VALIDITY_VALID
    assert flight.error_deg(heading) < 2.0


def test_a_silence_is_not_bridged():
    flight = SunFilterFlight(unit((0.2, 0.3, 0.93)), TURNING, white=0.002, **NO_EARTH)
    flight.fly(60.0)
    aiding = UNAIDED._replace(sky=flight.sky)
    flight.state, heading = sun_filter.step(flight.p, flight.state, flight.memory, 60.0, flight.voltages(), aiding)
    assert heading.mode == filter_state.MODE_SEARCHING
    assert flight.error_deg(flight.fly(30.0)) < 1.0


@pytest.mark.parametrize("gyro", [True, False], ids=["gyro", "no gyro"])
def test_errors_are_as_large_as_the_filter_says(gyro):
    """NEES and NIS are chi-square where the model is the truth (Bar-Shalom, Li & Kirubarajan, chapter 5)."""
    squared, innovations, freedom = [], 0.0, 0
    cases = 40
    for seed, sun_b in enumerate(directions(cases)):
        flight = SunFilterFlight(sun_b, TURNING, seed, white=0.02, **SIX, **NO_EARTH, **EXACT)
        heading = flight.fly(60.0, gyro=gyro)
        for _ in range(50):
            heading = flight.step(gyro=gyro)
            innovations += heading.nis
            freedom += heading.nis_dof
        squared.append(flight.squared_error(heading))
    # 99.9 % of the mean of 40 chi-square numbers of two degrees of freedom
    assert 1.1 < np.mean(squared) < 3.2
    assert 0.9 < innovations / freedom < 1.1


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"calibration__gains": [1.0] * 7}, r"calibration\.gains: 7 numbers given, expected one for each of 8"),
        ({"calibration__darks": [0.0] * 9}, r"calibration\.darks: 9 numbers"),
        ({"calibration__normals": [0.0, 0.0, 1.0]}, r"calibration\.normals: 1 rows"),
        ({"calibration__gains": [1.0] * 7 + [0.0]}, r"gains above 0"),
        ({"calibration__normals": [0.0] * 24}, r"a row of zeros"),
        ({"response__curve": "table"}, r"response\.table: 0 numbers"),
        ({"spacecraft__inertia": [0.0] * 9}, r"principal moment of 0"),
    ],
)
def test_a_calibration_that_fits_no_cells_is_refused(changes, words):
    messages = list(SunFilter.conflicts(okeefe_values(SunFilter.table(), **changes)))
    assert len(messages) == 1 and re.search(words, messages[0]), messages


def test_gains_darks_normals_and_response_are_those_of_the_calibration():
    """Cells that differ from the nominal, of which the filter is told, are as good as nominal ones."""
    dice = np.random.default_rng(4)
    flight = SunFilterFlight(unit((0.05, 0.1, 0.99)), white=0.002, **NO_EARTH)
    normals = np.column_stack([flight.p.cells[name] for name in ("nx", "ny", "nz")])
    tilted = normals + 0.03 * dice.normal(size=normals.shape)
    tilted /= np.linalg.norm(tilted, axis=1, keepdims=True)
    calibration = {
        "calibration__gains": (1.0 + 0.1 * dice.normal(size=8)).tolist(),
        "calibration__darks": (0.03 * dice.normal(size=8)).tolist(),
        "calibration__normals": tilted.ravel().tolist(),
        "response__curve": "table",
        "response__table": (np.linspace(0.0, 1.0, 21) ** 1.2).tolist(),
    }
    told = SunFilterFlight(unit((0.05, 0.1, 0.99)), white=0.002, **NO_EARTH, **calibration)

    def as_built(voltages):
        light = np.maximum(voltages, 0.0) ** 1.2
        voltages[:] = told.p.cells["gain"] * light + told.p.cells["dark"]

    assert told.error_deg(told.fly(60.0, change=as_built)) < 0.5
    assert flight.error_deg(flight.fly(60.0, change=as_built)) > 2.0


@pytest.mark.parametrize("curve", ["cosine", "okeefe", "table"])
def test_the_slope_of_a_response_is_its_derivative(curve):
    table = {"response__table": [0.0, 0.3, 0.7, 1.0]} if curve == "table" else {}
    p = sun_filter.parameters(okeefe_values(SunFilter.table(), response__curve=curve, **table)).response
    for light in (0.1, 0.4, 0.6, 0.9):
        above, below = respond(p, light + 1e-6)[0], respond(p, light - 1e-6)[0]
        assert respond(p, light)[1] == pytest.approx((above - below) / 2e-6, rel=1e-6)


@pytest.mark.parametrize("mean", [-0.3, -0.05, -0.01, 0.0, 0.02, 0.08, 0.5])
def test_a_cell_at_grazing_light_is_taken_for_both(mean):
    """Mean, best slope and what it leaves of max(0, c), against quadrature over a normal c."""
    sigma = 0.05
    c = mean + sigma * np.linspace(-8.0, 8.0, 20001)
    weights = np.exp(-0.5 * ((c - mean) / sigma) ** 2)
    weights /= weights.sum()
    lit = np.maximum(c, 0.0)
    expected = weights @ lit
    slope = weights @ ((c - mean) * lit) / sigma**2
    left = weights @ (lit - expected - slope * (c - mean)) ** 2
    np.testing.assert_allclose(rising(mean, sigma**2), (expected, slope, left), atol=2e-6)


@pytest.mark.parametrize("output", [0.0, 0.002, 0.01, 0.03])
def test_noise_that_ends_with_the_converter_is_taken_for_what_it_is(output):
    """Mean, spread and slope of max(low, output + noise) against draws; a dark cell reads 0.4 of the noise."""
    noise, low, dark = 0.006, 0.0, -0.001
    p = sun_filter.parameters(
        okeefe_values(SunFilter.table(), noise=noise, output_low=low, calibration__darks=[dark] * 8)
    )
    draws = noise * np.random.default_rng(3).normal(size=400_000)
    read = np.maximum(low - dark, output + draws)
    mean, slope, variance = read_above(p, output, low - dark)
    assert mean == pytest.approx(read.mean(), abs=4e-5)
    assert slope == pytest.approx(np.mean(output + draws > low - dark), abs=4e-3)
    assert variance == pytest.approx(read.var(), rel=0.02)
    nowhere = sun_filter.parameters(okeefe_values(SunFilter.table(), noise=noise))
    assert read_above(nowhere, output, nowhere.cells[0]["low"]) == (output, 1.0, nowhere.errors.noise)


def test_what_a_calibration_takes_off_it_takes_off_the_end_of_the_converter():
    """A dark level of 0.4 of the noise is that of the converter's end, which the filter knows."""
    noise, scales = 0.005, [1.0, 0.9, 1.1, 1.0, 1.0, 1.0, 1.0, 1.0]
    darks = [0.002, 0.0025, 0.05, -0.002, 0.0, 0.0031, 0.002, 0.002]
    measured = {"cells__measured__scales": scales, "cells__measured__darks": darks}
    cells = sun_filter.parameters(okeefe_values(SunFilter.table(), noise=noise, output_low=0.0, **measured)).cells
    raw = np.array([0.0, 0.3, 0.9])
    for i, (scale, dark) in enumerate(zip(scales, darks, strict=True)):
        heard = (raw - dark) / scale  # as the node corrects what it hears
        level = 0.0 if abs(dark) < 0.6 * noise else dark
        np.testing.assert_allclose(heard - cells[i]["dark"], (raw - level) / scale, atol=1e-15)
        assert cells[i]["low"] - cells[i]["dark"] == pytest.approx((0.0 - level) / scale, abs=1e-15)


def test_faces_that_graze_the_sun_do_not_mislead():
    """The kink at 90 deg: a linear filter is sure of a side that it cannot know, and stays degrees off."""
    for seed in range(6):
        flight = SunFilterFlight(unit((0.05, -0.03, 1.0)), (0.004, 0.03, -0.01), seed, 0.005, (0.5, 0.8, 0.3), **SIX)
        errors, normalised = [], []
        for _ in range(900):
            heading = flight.step()
            errors.append(flight.error_deg(heading))
            normalised.append(np.radians(errors[-1]) ** 2 / sum(heading.covariance[::4]))
        assert np.mean(errors[600:]) < 1.0
        assert np.mean(normalised[300:]) < 4.0
