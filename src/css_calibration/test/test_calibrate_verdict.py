# SPDX-License-Identifier: Apache-2.0
"""When a calibration is not as it should be: nothing told, or headings worse than before."""

from types import SimpleNamespace

import numpy as np
import pytest

from css_calibration.verbs.calibrate import _shortcoming


def result(before_deg, after_deg, told=True):
    angles = [np.radians(np.full(3 if value is not None else 0, value or 0.0)) for value in (before_deg, after_deg)]
    return SimpleNamespace(observed=np.array([[told]]), before=angles[0], after=angles[1])


@pytest.mark.parametrize(
    ("before", "after", "told", "wrong"),
    [
        (2.0, 0.3, True, ""),
        (0.3, 2.0, True, "errs by 2.000 deg, by 0.300 before"),
        # cells that were right already
        (1e-9, 2e-9, True, ""),
        (None, None, True, ""),
        (0.3, 0.2, False, "no parameter of any cell was told"),
    ],
)
def test_only_headings_that_are_worse_are_a_shortcoming(before, after, told, wrong):
    found = _shortcoming(result(before, after, told))
    assert wrong in found and bool(found) == bool(wrong)
