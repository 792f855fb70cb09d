# SPDX-License-Identifier: Apache-2.0
"""Does the Sun of the truth stand where the cells are bright? Wrong orders, directions and frames show there."""

from typing import NamedTuple

import numpy as np

from css_telemetry.telemetry import Telemetry
from css_telemetry.true_states import TrueStates, sun_b_of

DOUBTFUL_DEG = 15.0
"""Angle above which one of both is not what the description says: more than albedo does to six faces on average."""

_LIT = 0.1  # of the output of a cell that the Sun meets head-on
_LEAST_LINES = 10
_MOST_LINES = 2000
_WELL_SPREAD = 0.05  # least over largest eigenvalue of the normals of lit cells


class SunCheck(NamedTuple):
    """Median angle of the Sun of the truth to that of the lit cells by least squares."""

    median_deg: float
    lines: int

    @property
    def doubtful(self) -> bool:
        """Whether truth and cells contradict each other."""
        return self.median_deg > DOUBTFUL_DEG


def sun_check(telemetry: Telemetry, states: TrueStates) -> SunCheck | None:
    """Compares lines in which lit cells tell the Sun; None: too few do."""
    normals = np.array([cell.normal_b for cell in telemetry.description.cells])
    picked = states.rows[states.illumination > 0.5]
    sun_b = sun_b_of(states)[states.illumination > 0.5]
    step = max(1, len(picked) // _MOST_LINES)
    angles = []
    for row, true in zip(picked[::step], sun_b[::step], strict=True):
        found = lit_direction(normals, telemetry.cells[row])
        if found is not None:
            angles.append(np.arctan2(np.linalg.norm(np.cross(found, true)), found @ true))
    if len(angles) < _LEAST_LINES:
        return None
    return SunCheck(float(np.degrees(np.median(angles))), len(angles))


def lit_direction(normals: np.ndarray, outputs: np.ndarray) -> np.ndarray | None:
    """(3,) along the Sun that lit cells show by least squares; None: they tell no direction.

    A cell that looks away from what all of them show is lit by the Earth: on six faces it would pull the Sun of the
    opposite face to half of what that reads. The one that looks away most is left out at a time.

    Args:
        normals: (N, 3).
        outputs: (N,) [-], NaN where missing.
    """
    lit = np.flatnonzero(outputs > _LIT)
    while len(lit) >= 3:
        moments = normals[lit].T @ normals[lit]
        values = np.linalg.eigvalsh(moments)
        if values[0] < _WELL_SPREAD * values[2]:
            return None
        found: np.ndarray = np.linalg.solve(moments, normals[lit].T @ outputs[lit])
        cosines = normals[lit] @ found
        if cosines.min() > 0.0:
            return found
        lit = np.delete(lit, np.argmin(cosines))
    return None
