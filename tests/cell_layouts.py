# SPDX-License-Identifier: Apache-2.0
"""Layouts of cells that spacecraft carry, as settings of the section `cells`."""

import numpy as np
from okeefe_spacecraft import STATED

from css_common.mission import load_mission

_FACES = np.vstack([np.eye(3), -np.eye(3)])


def _pyramid(axis, count=4, off_axis_deg=45.0):
    azimuths = 2.0 * np.pi * np.arange(count) / count
    off = np.radians(off_axis_deg)
    return np.column_stack(
        [np.sin(off) * np.cos(azimuths), np.sin(off) * np.sin(azimuths), axis * np.cos(off) * np.ones(count)]
    )


def _settings(normals, view_deg=180.0):
    return {
        "cells__normals": np.asarray(normals, dtype=float).ravel().tolist(),
        "cells__field_of_view_deg": view_deg,
        "cells__clip_normal": [0.0, 0.0, 0.0],
    }


LAYOUTS = {
    "dual_pyramid": {name: STATED[name] for name in STATED if name.startswith("cells__")},
    "six_faces": _settings(_FACES),
    "twelve_faces": _settings(np.repeat(_FACES, 2, axis=0)),
    "single_pyramid": _settings(_pyramid(1.0), 120.0),
    "four_coplanar": _settings(_pyramid(1.0, off_axis_deg=90.0)),
    "clark": _settings(load_mission("clark_1996_flat").values.cells.normals, 166.0),
}
"""Dual pyramid of O'Keefe & Schaub, six faces with one cell or two, a single pyramid, a belt of four, Clark's 14."""
