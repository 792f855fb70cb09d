# SPDX-License-Identifier: Apache-2.0
"""Cells that look the same way share a label on the body sphere; each has one."""

from css_common.mission import load_mission
from css_report.body_map import _alike


def test_cells_of_a_face_share_a_label():
    normals = load_mission("clark_1996_flat").node("flat").values.cells.normals
    assert _alike(normals) == [[0, 1], [2, 3], [4, 5, 6], [7, 8, 9], [10, 11], [12, 13]]


def test_cells_of_a_pyramid_have_one_each():
    normals = load_mission("okeefe_2013").node("ekf").values.cells.normals
    assert _alike(normals) == [[i] for i in range(8)]
