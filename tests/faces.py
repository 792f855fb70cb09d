# SPDX-License-Identifier: Apache-2.0
"""Telemetry of a cubesat as a table: six faces, the Sun 30 deg up, turning about z at 1 deg/s past the cells on +x, -y
and -x; a line a second, no noise.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from css_telemetry.commands import import_csv

FACES = ("px", "mx", "py", "my", "pz", "mz")
NORMALS = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)
LINES = 120
LAYOUT = "cells:\n" + "".join(f"  {f}: {n.tolist()}\n" for f, n in zip(FACES, NORMALS, strict=True))


def recording(folder: Path, given: Callable[[int, str, float], str]) -> Path:
    """An imported table; `given` makes the text of a cell's output of a line, face and value."""
    lines = [",".join(("time", *FACES, "omega_x_deg_s,omega_y_deg_s,omega_z_deg_s,sun_x,sun_y,sun_z"))]
    for k in range(LINES):
        azimuth, elevation = np.radians(-k), np.radians(30.0)
        sun_b = np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)
        cells = [given(k, face, max(0.0, n @ sun_b)) for face, n in zip(FACES, NORMALS, strict=True)]
        lines.append(",".join((str(1_700_000_000 + k), *cells, "0,0,1", *(f"{c:.9f}" for c in sun_b))))
    (folder / "table.csv").write_text("\n".join(lines) + "\n")
    (folder / "layout.yaml").write_text(LAYOUT + "field_of_view_deg: 180.0\n")
    files = (str(folder / "table.csv"), str(folder / "layout.yaml"))
    assert import_csv.main([*files, "-o", str(folder / "bag"), "--epoch", "1970-01-01T00:00:00Z"]) == 0
    return folder / "bag"
