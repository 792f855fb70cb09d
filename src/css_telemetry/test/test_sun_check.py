# SPDX-License-Identifier: Apache-2.0
"""The Sun that lit cells show, beside the Earth on the cells that look away from it."""

import numpy as np
import pytest

from css_telemetry.sun_check import lit_direction

FACES = np.vstack([np.eye(3), -np.eye(3)])
SUN = np.array([0.6, 0.48, 0.64])


def off_deg(outputs: np.ndarray, normals: np.ndarray = FACES) -> float:
    found = lit_direction(normals, outputs)
    assert found is not None
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(found, SUN)), found @ SUN)))


@pytest.mark.parametrize("face", range(3, 6))
def test_a_face_that_the_earth_lights_from_behind_does_not_halve_the_sun_on_the_other_side(face):
    outputs = np.maximum(FACES @ SUN, 0.0)
    assert off_deg(outputs) < 1e-6
    outputs[face] = 0.25
    assert off_deg(outputs) < 1e-6


def test_earth_on_several_faces_moves_the_sun_by_what_it_adds_to_lit_ones_alone():
    outputs = np.maximum(FACES @ SUN, 0.0) + np.array([0.0, 0.1, 0.0, 0.3, 0.2, 0.3])
    assert off_deg(outputs) < 6.0


def test_two_lit_cells_tell_no_direction():
    assert lit_direction(FACES, np.array([0.9, 0.4, 0.0, 0.0, 0.0, 0.0])) is None
    # nor do two and one that the Earth lights from behind, nor missing outputs
    assert lit_direction(FACES, np.array([0.9, 0.4, 0.0, 0.2, 0.0, 0.0])) is None
    assert lit_direction(FACES, np.full(6, np.nan)) is None
