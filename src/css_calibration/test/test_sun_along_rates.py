# SPDX-License-Identifier: Apache-2.0
"""The Sun by cells and rates together: where it is, whatever one cell says, and when nobody knows."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from css_calibration.recorded import Recorded
from css_calibration.sun_along_rates import sun_along_rates
from css_calibration.sun_by_cells import ABSOLUTE
from css_common.mission import mission_from_text

FACES = np.vstack([np.eye(3), -np.eye(3)])
RATE_B = np.radians([1.5, -0.8, 1.0])
SAMPLES = 600
ALLOWED_DEG = np.degrees(np.arcsin(ABSOLUTE))
"""What an output may be off without contradicting a Sun turns it by so much."""
MISSION = mission_from_text(
    "/**:\n  ros__parameters:\n    mission: {name: six}\n"
    f"    cells: {{normals: {FACES.ravel().tolist()}, field_of_view_deg: 180.0}}\n",
    "six",
)


@pytest.fixture
def flight():
    """Ten minutes of a body that turns evenly, and where the Sun was."""
    time = np.arange(float(SAMPLES))
    sun_b = Rotation.from_rotvec(-np.outer(time, RATE_B)).apply([0.6, 0.48, 0.64])
    voltages = np.maximum(sun_b @ FACES.T, 0.0) + np.random.default_rng(6).normal(0.0, 0.01, (SAMPLES, 6))
    stamps = np.round(time * 1e9).astype(np.int64)
    gyro = RATE_B + np.radians([0.02, -0.02, 0.01])  # with a bias
    recorded = Recorded(
        "six", MISSION, stamps, voltages, np.zeros((SAMPLES, 6), np.bool_), stamps, np.tile(gyro, (SAMPLES, 1))
    )
    return recorded, sun_b


def apart_deg(found, sun_b):
    known = np.isfinite(found).all(axis=1)
    cosine = np.clip(np.sum(found[known] * sun_b[known], axis=1), -1.0, 1.0)
    return np.degrees(np.arccos(cosine)), known


@pytest.mark.parametrize("spoilt", [None, "dead", "half"])
def test_a_cell_that_loses_light_does_not_move_it(flight, spoilt):
    recorded, sun_b = flight
    if spoilt is not None:
        recorded.voltages[200:, 0] *= 0.0 if spoilt == "dead" else 0.5
    found = sun_along_rates(recorded)
    assert found is not None
    apart, known = apart_deg(found, sun_b)
    assert known.mean() > 0.9 and np.percentile(apart, 95.0) < ALLOWED_DEG


def test_in_the_dark_nobody_knows_it(flight):
    recorded, _ = flight
    recorded.voltages[300:] = 0.0
    recorded.voltages[300:, 2] = 0.5  # stuck
    found = sun_along_rates(recorded)
    assert found is not None and not np.isfinite(found[320:]).any() and np.isfinite(found[:280]).mean() > 0.9


def test_rates_that_contradict_the_cells_are_not_used(flight):
    recorded, _ = flight
    recorded.gyro_b = -recorded.gyro_b
    assert sun_along_rates(recorded) is None
    recorded.gyro_ns, recorded.gyro_b = recorded.gyro_ns[:0], recorded.gyro_b[:0]
    assert sun_along_rates(recorded) is None
