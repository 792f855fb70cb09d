# SPDX-License-Identifier: Apache-2.0
"""Outputs that a calibration expects, against closed forms, and their derivatives against differences."""

import math

import numpy as np
import pytest

from css_calibration.cell_data import CellData
from css_calibration.cell_fit_model import DARK, EARTH, GAIN, KAPPA, TILT_1, TILT_2, nominal_parameters, response_of
from css_calibration.snapshot_heading import heading_errors

NORMALS = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.6, 0.0, 0.8]])


def data(sun_b, curve=0, **changed):
    """Six faces' worth of nothing: outputs are to be predicted."""
    sun_b = np.ascontiguousarray(sun_b, dtype=float)
    shape = (len(sun_b), len(NORMALS))
    fields = {
        "voltages": np.zeros(shape), "sun_b": sun_b, "intensity": np.ones(len(sun_b)), "seen": np.ones(shape, bool),
        "usable": np.ones(shape, bool), "at_edge": np.zeros(shape, bool), "albedo": np.zeros(shape),
        "warmth": np.zeros(len(sun_b)), "time": np.arange(len(sun_b), dtype=float), "turned": np.zeros(len(sun_b)),
    }  # fmt: skip
    return CellData(NORMALS, response=response_of(curve), earth_known=True, **(fields | changed))


def random_suns(count=40):
    suns = np.random.default_rng(1).normal(size=(count, 3))
    return suns / np.linalg.norm(suns, axis=1, keepdims=True)


def test_a_cell_reads_dark_level_and_scaled_cosine():
    parameters = nominal_parameters(4)
    parameters[0, GAIN], parameters[0, DARK] = 1.2, 0.03
    sun_b = [[math.cos(0.5), math.sin(0.5), 0.0], [-1.0, 0.0, 0.0]]
    out, _, _ = data(sun_b).predicted(parameters, 1.0)
    assert out[0, 0] == pytest.approx(0.03 + 1.2 * math.cos(0.5), abs=1e-15)
    assert out[1, 0] == pytest.approx(0.03, abs=1e-15)
    assert out[0, 1] == pytest.approx(math.sin(0.5), abs=1e-15)


def test_a_tilt_turns_the_normal_by_its_angle():
    tilt = math.radians(3.0)
    parameters = nominal_parameters(4)
    parameters[0, TILT_1] = math.tan(tilt)
    out, _, turns = data([[1.0, 0.0, 0.0]]).predicted(parameters, 1.0)
    assert out[0, 0] == pytest.approx(math.cos(tilt), abs=1e-12)
    assert np.linalg.norm(turns[0, 0]) == pytest.approx(1.0, abs=1e-12)


def test_warmth_and_earth_enter_as_stated():
    parameters = nominal_parameters(4)
    parameters[:, KAPPA] = 0.01
    one = data([[1.0, 0.0, 0.0]], warmth=np.array([5.0]), albedo=np.full((1, 4), 0.1))
    out, _, _ = one.predicted(parameters, 2.0)
    assert out[0, 0] == pytest.approx(1.05 * 1.2, abs=1e-12)
    assert out[0, 1] == pytest.approx(1.05 * 0.2, abs=1e-12)


@pytest.mark.parametrize("curve", [0, 1])
def test_derivatives_are_those_of_differences(curve):
    rng = np.random.default_rng(2)
    suns = random_suns()
    parameters = nominal_parameters(4)
    parameters += rng.normal(0.0, [0.1, 0.02, 0.05, 0.05, 0.002], parameters.shape)
    d = data(suns, curve, warmth=rng.normal(0.0, 10.0, len(suns)), albedo=rng.uniform(0.0, 0.2, (len(suns), 4)))
    out, slopes, turns = d.predicted(parameters, 1.3)
    clear = np.abs(suns @ NORMALS.T) > 0.15  # away from the kink
    step = 1e-6
    for k in (GAIN, DARK, TILT_1, TILT_2, KAPPA):
        more = parameters.copy()
        more[:, k] += step
        by = (d.predicted(more, 1.3)[0] - out) / step
        assert np.abs((by - slopes[:, :, k])[clear]).max() < 2e-5
    by = (d.predicted(parameters, 1.3 + step)[0] - out) / step
    assert np.abs((by - slopes[:, :, EARTH])[clear]).max() < 2e-5
    for j in range(3):
        moved = suns.copy()
        moved[:, j] += step
        by = (data(moved, curve, warmth=d.warmth, albedo=d.albedo).predicted(parameters, 1.3)[0] - out) / step
        assert np.abs((by - turns[:, :, j])[clear]).max() < 2e-5


def test_a_heading_by_known_cells_is_the_true_one_and_by_others_is_not():
    suns = random_suns(200)
    suns = suns[(suns @ NORMALS[:3].T > 0.3).all(axis=1)]
    parameters = nominal_parameters(4)
    parameters[:, GAIN] = [1.1, 0.9, 1.05, 0.97]
    d = data(suns, 1)
    d.voltages = d.predicted(parameters, 1.0)[0]
    assert np.nanmax(heading_errors(d, parameters, 1.0)) < 1e-6
    assert np.nanmin(heading_errors(d, nominal_parameters(4), 1.0)) > np.radians(0.5)


def test_one_lit_cell_tells_no_heading():
    d = data([[1.0, 0.0, 0.0]])
    d.usable[0] = [True, False, False, False]
    d.voltages = d.predicted(nominal_parameters(4), 1.0)[0]
    assert np.isnan(heading_errors(d, nominal_parameters(4), 1.0)[0])
