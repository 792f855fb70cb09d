# SPDX-License-Identifier: Apache-2.0
"""Dark levels, where light of the Earth that nobody predicts shines on a cell now and then."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from css_calibration.cell_bounds import dark_levels
from css_calibration.cell_fit_model import DARK

COUNT = 600
EARTH = np.maximum(0.0, 0.2 * np.sin(np.linspace(0.0, 4.0 * np.pi, COUNT)))  # half of the time none


def levels(outputs, fitted, *, earth_known=False, seen=False) -> np.ndarray:
    """Of one cell with outputs (M,), for which a batch found a dark level."""
    noise = 0.005 * np.random.default_rng(3).normal(size=COUNT)
    all_of = np.ones((COUNT, 1), np.bool_)
    data: Any = SimpleNamespace(
        voltages=(outputs + noise)[:, None], usable=all_of, seen=all_of & seen, earth_known=earth_known
    )
    parameters = np.zeros((1, 5))
    parameters[0, DARK] = fitted
    result: Any = SimpleNamespace(parameters=parameters)
    (level,) = dark_levels(data, result)
    assert parameters[0, DARK] == fitted, "the batch's own stays"
    return level


def test_light_that_comes_and_goes_is_no_dark_level():
    assert levels(EARTH, EARTH.mean()) == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("bias", [0.3, -0.2])
def test_a_level_below_which_a_cell_never_reads_is_one(bias):
    assert levels(bias + EARTH, bias) == pytest.approx(bias, abs=0.02)


def test_what_is_predicted_has_not_passed_for_a_level():
    assert levels(EARTH, 0.06, earth_known=True) == 0.06


def test_a_cell_that_is_always_lit_tells_nothing_else():
    assert levels(0.5 + EARTH, 0.1, seen=True) == 0.1
