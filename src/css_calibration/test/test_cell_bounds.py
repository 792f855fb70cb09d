# SPDX-License-Identifier: Apache-2.0
"""Dark levels, where light of the Earth that nobody predicts shines on a cell now and then."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from css_calibration.cell_bounds import dark_levels, unpredicted_earth
from css_calibration.cell_fit_model import DARK
from css_calibration.slow_faults import ageing
from css_common.health import KIND_DRIFTING

COUNT = 600
EARTH = np.maximum(0.0, 0.2 * np.sin(np.linspace(0.0, 4.0 * np.pi, COUNT)))  # half of the time none


def levels(outputs, fitted, *, earth_known=False, seen=False, beside=EARTH) -> float:
    """Of a cell with outputs (M,), for which a batch found a dark level, next to another one."""
    noise = 0.005 * np.random.default_rng(3).normal(size=(COUNT, 2))
    all_of = np.ones((COUNT, 2), np.bool_)
    voltages = np.stack([outputs, beside], axis=1) + noise
    data: Any = SimpleNamespace(voltages=voltages, usable=all_of, seen=all_of & [seen, False], earth_known=earth_known)
    parameters = np.zeros((2, 5))
    parameters[0, DARK] = fitted
    result: Any = SimpleNamespace(parameters=parameters)
    level = dark_levels(data, result)[0]
    assert parameters[0, DARK] == fitted, "the batch's own stays"
    return float(level)


def test_light_that_comes_and_goes_is_no_dark_level():
    assert levels(EARTH, EARTH.mean()) == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("bias", [0.3, -0.2])
def test_a_level_below_which_a_cell_never_reads_is_one(bias):
    assert levels(bias + EARTH, bias) == pytest.approx(bias, abs=0.02)


def test_what_comes_and_goes_where_others_see_no_earth_is_no_earth():
    assert levels(EARTH, 0.12, beside=np.zeros(COUNT)) == pytest.approx(0.12, abs=0.03)


def test_what_is_predicted_has_not_passed_for_a_level():
    assert levels(EARTH, 0.06, earth_known=True) == 0.06


def test_a_cell_that_is_always_lit_tells_nothing_else():
    assert levels(0.5 + EARTH, 0.1, seen=True) == 0.1


def earth_beside(cell: int, outputs: np.ndarray, *, earth_known=False) -> float:
    all_of = np.ones(outputs.shape, np.bool_)
    data: Any = SimpleNamespace(voltages=outputs, usable=all_of, seen=~all_of, earth_known=earth_known)
    return unpredicted_earth(data, cell)


def test_the_earth_of_a_recording_is_what_other_cells_read_without_the_sun():
    outputs = np.stack([np.linspace(0.0, 0.6, COUNT), EARTH, 0.5 * EARTH], axis=1)
    assert earth_beside(0, outputs) == pytest.approx(0.2, abs=0.01), "not what the cell itself reads too much"
    assert earth_beside(1, outputs[:, 1:]) == pytest.approx(0.2, abs=0.01)
    assert earth_beside(0, outputs, earth_known=True) == 0.0
    assert earth_beside(0, outputs[:, :1]) == 0.0, "of one cell alone nothing is known"


@pytest.mark.parametrize(("earth_known", "told"), [(True, True), (False, False)])
def test_a_scale_changes_with_age_where_the_earth_cannot_be_the_cause(earth_known, told):
    lit = np.full((COUNT, 1), 0.6) * (1.0 + np.linspace(-0.1, 0.1, COUNT))[:, None]
    noise = 0.004 * np.random.default_rng(8).normal(size=(COUNT, 2))
    outputs = np.hstack([lit, EARTH[:, None]]) + noise
    expected = np.hstack([np.full((COUNT, 1), 0.6), np.zeros((COUNT, 1))])
    seen = np.array([True, False]) & np.ones((COUNT, 2), np.bool_)
    data: Any = SimpleNamespace(
        voltages=outputs,
        usable=np.ones((COUNT, 2), np.bool_),
        seen=seen,
        earth_known=earth_known,
        time=np.arange(float(COUNT)),
        predicted=lambda parameters, earth: (expected, None, None),
    )
    result: Any = SimpleNamespace(parameters=np.zeros((2, 5)), earth=0.0)
    slow = ageing(data, result, 0)
    assert (slow is not None) == told
    assert slow is None or slow.kind == KIND_DRIFTING
