# SPDX-License-Identifier: Apache-2.0
"""What missions may say of cells, slits and payload, and what is the same for simulation and flight software."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from css_common.schema import default_values
from css_common.shared_sections import conflicts, shared_sections
from css_sensors.cells import CELLS, IN_PLANE, half_view_cosine, plane_sides
from css_sensors.sections import SECTIONS
from css_sensors.slits import SLITS, TIMER_SPAN, counts_between, head_azimuths, slit_inclination, timer_frequency


def test_missions_have_the_sections():
    assert shared_sections().items() >= SECTIONS.items()


ONE = {"payload__spin_hz": [5.45], "payload__coning_period": [0.2618], "payload__coning_angle_deg": [12.89]}
TWO = {"payload__phase_starts": [0.0, 50.0], "payload__spin_hz": [5.0, 2.0], "payload__coning_angle_deg": [9.0, 8.0]}
CONFLICTS = [
    ("cells", {"cells__normals": [1, 0, 0] * 33}, "cells.normals: 33 rows given, expected 1 to 32"),
    ("cells", {"cells__normals": [1, 0, 0, 0, 2, 0]}, "cells.normals: row 1 has length 2"),
    ("cells", {"cells__clip_normal": [0, 0, 0.1]}, "cells.clip_normal: length 0.1 given"),
    ("payload", {"payload__phase_starts": [1.0]}, "payload.phase_starts: [1.0] given, expected times that grow from 0"),
    ("payload", ONE | TWO, "payload.coning_period: 1 values given, expected 2, one for each phase"),
    (
        "payload",
        ONE | {"payload__coning_period": [0.05]},
        "payload.coning_period: the coning is 3.67 times as fast as the",
    ),
    (
        "payload",
        ONE | {"payload__flat_spin_start": 0.0},
        "payload.flat_spin_start: 0 given, expected a time after the last",
    ),
    (
        "payload",
        ONE | {"payload__flat_spin_angle_deg": 6.0},
        "payload.flat_spin_angle_deg: expected more than half the",
    ),
    ("slits", {"slits__head_azimuths_deg": []}, "slits.head_azimuths_deg: 0 given, expected 1 to 8"),
    ("slits", {"slits__head_azimuths_deg": [0.0, -360.0]}, "slits.head_azimuths_deg: two heads at one place"),
]


@pytest.mark.parametrize(("section", "changes", "expected"), CONFLICTS)
def test_values_that_conflict_are_named(section, changes, expected):
    changes = {k: [float(x) for x in v] if isinstance(v, list) else v for k, v in changes.items()}
    found = list(conflicts(default_values(SECTIONS[section].table, **changes)))
    assert any(line.startswith(expected) for line in found), found
    assert all("\n" not in line for line in found)


def test_a_cell_in_the_body_plane_has_no_side():
    normals = [1.0, 0.0, 0.0, 0.6, 0.0, 0.8, 0.6, 0.0, -0.8, 1.0, 0.0, 0.5 * IN_PLANE]
    values = default_values(CELLS, cells__normals=normals, cells__clip_normal=[0.0, 0.0, 1.0])
    assert plane_sides(values).tolist() == [0.0, 0.8, -0.8, 0.0]
    assert plane_sides(default_values(CELLS, cells__normals=normals)).tolist() == [0.0] * 4


def test_numbers_that_algorithms_take():
    assert half_view_cosine(default_values(CELLS, cells__field_of_view_deg=120.0)) == pytest.approx(0.5)
    values = default_values(
        SLITS, slits__counter_hz=2e6, slits__inclination_deg=45.0, slits__head_azimuths_deg=[0.0, 90.0]
    )
    assert timer_frequency(values) == 2e6
    assert math.tan(slit_inclination(values)) == pytest.approx(1.0)
    assert np.cos(head_azimuths(values)) == pytest.approx([1.0, 0.0])


@given(st.integers(0, 2**40), st.integers(-(2**31), 2**31 - 1))
def test_counts_apart_over_the_wrap_of_the_timer(count, apart):
    assert counts_between((count + apart) % TIMER_SPAN, count % TIMER_SPAN) == apart
