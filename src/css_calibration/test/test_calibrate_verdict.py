# SPDX-License-Identifier: Apache-2.0
"""When a calibration is not as it should be: nothing told, or headings worse than before."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from css_calibration.calibration_result import unobserved_combinations
from css_calibration.unknowns import Ignorance, all_of
from css_calibration.verbs.calibrate import _shortcoming


def result(before_deg, after_deg, told=True):
    angles = [np.radians(np.full(3 if value is not None else 0, value or 0.0)) for value in (before_deg, after_deg)]
    observed = np.zeros((2, 5), np.bool_)
    observed[0, 1] = told is not False
    observed[0, 0] = told is True
    return SimpleNamespace(observed=observed, before=angles[0], after=angles[1])


@pytest.mark.parametrize(
    ("before", "after", "told", "wrong"),
    [
        (2.0, 0.3, True, ""),
        (0.3, 2.0, True, "errs by 2.000 deg, by 0.300 before"),
        # cells that were right already
        (1e-9, 2e-9, True, ""),
        (None, None, True, ""),
        (0.3, 0.2, False, "no parameter of any cell was told"),
        # a flight in the shadow of the Earth
        (None, None, "dark", "dark levels alone were told"),
    ],
)
def test_only_headings_that_are_worse_are_a_shortcoming(before, after, told, wrong):
    found = _shortcoming(result(before, after, told))
    assert wrong in found and bool(found) == bool(wrong)


def test_what_was_not_told_is_named_by_cell_and_mixtures_by_their_parts():
    unknowns = all_of(2, temperature=False, earth=False, ignorance=Ignorance())
    information = np.diag([1e6, 1e6, 0.0, 0.0, 1e6, 1e6, 1e6, 1e6])
    information[4:6, 4:6] = 1e6 * np.array([[1.0, 1.0], [1.0, 1.0]])  # their sum alone
    fit = SimpleNamespace(unknowns=unknowns, information=information)
    made: Any = SimpleNamespace(fit=fit, left=np.zeros((2, 5)))
    lines = unobserved_combinations(made)
    assert lines[0] == "cell 0: tilt_1, tilt_2"
    assert len(lines) == 2 and "cell 1: scale" in lines[1] and "cell 1: dark" in lines[1] and "0.71" in lines[1]
