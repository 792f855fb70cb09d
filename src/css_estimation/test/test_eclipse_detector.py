# SPDX-License-Identifier: Apache-2.0
"""Hysteresis of the cells' verdict on eclipse, and how it is joined with an orbit model's."""

import numpy as np
import pytest

from css_common.schema import default_values
from css_estimation.sun import eclipse_detector
from css_estimation.sun.eclipse_detector import detect_eclipse, initial_state
from css_estimation.sun.sun_heading import (
    ECLIPSE_ECLIPSED,
    ECLIPSE_SUNLIT,
    PREDICTION_ECLIPSED,
    PREDICTION_SUNLIT,
    PREDICTION_UNKNOWN,
)
from css_sensors.cells import CELLS


def parameters(**changes):
    return eclipse_detector.parameters(default_values(eclipse_detector.PARAMETERS, **changes))


def half_the_sky(**changes):
    """One cell, which sees the half of the sky in front of it."""
    table = eclipse_detector.PARAMETERS + CELLS
    values = default_values(table, cells__normals=[0.0, 0.0, 1.0], cells__field_of_view_deg=180.0, **changes)
    return eclipse_detector.parameters(values)


def verdicts(p, outputs, predicted=PREDICTION_UNKNOWN, dt=0.5):
    state, result = initial_state(), []
    for largest in outputs:
        state, eclipse = detect_eclipse(p, state, dt, largest, predicted)
        result.append(eclipse)
    return result


def test_darkness_needs_ten_seconds_and_light_five():
    p = parameters()
    result = verdicts(p, [0.9] * 4 + [0.0] * 30 + [0.9] * 20)
    assert result.index(ECLIPSE_ECLIPSED) == 4 + 20  # after more than 10 s at 0.5 s
    light_again = result.index(ECLIPSE_SUNLIT, 30)
    assert light_again == 34 + 10
    assert result[:24] == [ECLIPSE_SUNLIT] * 24
    assert result[light_again:] == [ECLIPSE_SUNLIT] * (54 - light_again)


def test_a_flash_restarts_the_count():
    p = parameters()
    assert ECLIPSE_ECLIPSED not in verdicts(p, ([0.0] * 20 + [0.9]) * 5)
    assert ECLIPSE_SUNLIT not in verdicts(p, [0.0] * 30 + ([0.9] * 10 + [0.0]) * 5)[24:]


def test_between_the_levels_the_verdict_stands():
    p = parameters()
    assert ECLIPSE_ECLIPSED not in verdicts(p, [0.2] * 100)
    assert ECLIPSE_SUNLIT not in verdicts(p, [0.0] * 30 + [0.2] * 100)[24:]


@pytest.mark.parametrize("predicted", [PREDICTION_SUNLIT, PREDICTION_ECLIPSED])
@pytest.mark.parametrize("largest", [0.0, 0.9])
def test_model_alone_decides_at_once(predicted, largest):
    p = parameters(eclipse__source="model")
    expected = ECLIPSE_ECLIPSED if predicted == PREDICTION_ECLIPSED else ECLIPSE_SUNLIT
    assert verdicts(p, [largest] * 50, predicted) == [expected] * 50


def test_both_must_agree():
    p = parameters(eclipse__source="both")
    assert verdicts(p, [0.0] * 50, PREDICTION_SUNLIT)[-1] == ECLIPSE_SUNLIT
    assert verdicts(p, [0.9] * 50, PREDICTION_ECLIPSED)[-1] == ECLIPSE_SUNLIT
    assert verdicts(p, [0.0] * 50, PREDICTION_ECLIPSED)[-1] == ECLIPSE_ECLIPSED


@pytest.mark.parametrize("source", ["model", "both"])
def test_without_a_prediction_the_cells_decide(source):
    p = parameters(eclipse__source=source)
    outputs = [0.9] * 4 + [0.0] * 30 + [0.9] * 20
    assert verdicts(p, outputs) == verdicts(parameters(), outputs)


@pytest.mark.parametrize(
    ("normals", "view_deg", "sees_all"),
    [
        (np.vstack([np.eye(3), -np.eye(3)]), 180.0, True),
        # 54.7 deg to the corner between three faces
        (np.vstack([np.eye(3), -np.eye(3)]), 108.0, False),
        ([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]], 180.0, False),
        ([[0.0, 0.0, 1.0]], 180.0, False),
    ],
)
def test_which_layouts_see_all_of_the_sky(normals, view_deg, sees_all):
    table = eclipse_detector.PARAMETERS + CELLS
    values = default_values(table, cells__normals=np.ravel(normals).tolist(), cells__field_of_view_deg=view_deg)
    assert eclipse_detector.parameters(values).sees_all == sees_all


def test_cells_that_never_saw_light_and_not_all_of_the_sky_are_no_night():
    dark = [0.0] * 100
    assert verdicts(parameters(), dark)[-1] == ECLIPSE_ECLIPSED
    assert ECLIPSE_ECLIPSED not in verdicts(half_the_sky(), dark)
    # once there was light they may tell one
    assert verdicts(half_the_sky(), [0.9, *dark])[-1] == ECLIPSE_ECLIPSED
    assert ECLIPSE_ECLIPSED not in verdicts(half_the_sky(), [0.2, *dark])


def test_no_night_of_theirs_is_longer_than_nights_are():
    result = verdicts(half_the_sky(eclipse__longest=60.0), [0.9] + [0.0] * 300)
    # 10 s of darkness begin it, at 0.5 s
    assert result == [ECLIPSE_SUNLIT] * 21 + [ECLIPSE_ECLIPSED] * 120 + [ECLIPSE_SUNLIT] * 160
    # after light there may be the next one
    again = verdicts(half_the_sky(eclipse__longest=60.0), [0.9] + [0.0] * 300 + [0.9] * 20 + [0.0] * 60)
    assert again[-1] == ECLIPSE_ECLIPSED


def test_the_model_has_to_agree_with_cells_that_do_not_see_all_of_the_sky():
    outputs = [0.9] + [0.0] * 100
    assert ECLIPSE_ECLIPSED not in verdicts(half_the_sky(), outputs, PREDICTION_SUNLIT)
    assert verdicts(half_the_sky(), outputs, PREDICTION_ECLIPSED)[-1] == ECLIPSE_ECLIPSED
    assert verdicts(half_the_sky(eclipse__longest=5.0), outputs, PREDICTION_ECLIPSED)[-1] == ECLIPSE_ECLIPSED
    assert verdicts(parameters(), outputs, PREDICTION_SUNLIT)[-1] == ECLIPSE_ECLIPSED
