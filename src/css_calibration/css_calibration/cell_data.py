# SPDX-License-Identifier: Apache-2.0
"""What of the outputs calibrates: those whose light is known, away from edges of views, of a Sun whole or gone.

Next to the edge of a view, or of the plane that hides half of the sky, a tilt of a few degrees decides whether a cell
sees the Sun at all: no derivative tells that, so such outputs are left out. In the shadow of the Earth a cell shows
what it reads in the dark, whatever its attitude.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from css_calibration.cell_fit_model import normals_of, predict_cells
from css_calibration.recorded import Recorded
from css_calibration.surroundings import Surroundings, earth_light
from css_common.direction_grid import grid_cell
from css_common.kernel import typed_call
from css_estimation.sun_filter.options import Response
from css_sensors.cells import blocked_directions, half_view_cosine, own_view_cosines, plane_sides

EDGE_DEG = 8.0
"""So near to the edge of its view a cell says nothing about its tilt."""
_PLANE_DEG = 4.0
_WHOLE, _GONE = 1e-3, 0.999  # part of the Sun that is hidden


@dataclass
class CellData:
    """Outputs of N cells at M instants, and the light on them.

    Attributes:
        normals_b: (N, 3) nominal.
        voltages: (M, N).
        sun_b: (M, 3) direction to the Sun, any unit vector where it is unknown.
        intensity: (M,) of sunlight.
        seen: (M, N) the Sun is in view.
        usable: (M, N) the output counts.
        at_edge: (M, N) it does not, for the Sun may be in view or not; no more than both is known of it.
        albedo: (M, N) of the mean Earth.
        warmth: (M,) temperature less that of reference [K].
        time: (M,) [s].
        turned: (M,) angle [rad] by which the body has turned up to then, by its attitude; 0 where that is unknown.
        response: of the cells.
        earth_known: `albedo` is a prediction; else there may be light that nobody predicts.
    """

    normals_b: np.ndarray
    voltages: np.ndarray
    sun_b: np.ndarray
    intensity: np.ndarray
    seen: np.ndarray
    usable: np.ndarray
    at_edge: np.ndarray
    albedo: np.ndarray
    warmth: np.ndarray
    time: np.ndarray
    turned: np.ndarray
    response: Response
    earth_known: bool

    def incidence_cosine(self, normals_b: np.ndarray) -> np.ndarray:
        """(M, N) cosines of the Sun on normals (N, 3)."""
        return self.sun_b @ normals_b.T

    def some(self, rows: np.ndarray) -> "CellData":
        """The same at some of the instants."""
        columns = ("voltages", "sun_b", "intensity", "seen", "usable", "at_edge", "albedo", "warmth", "time", "turned")
        chosen: dict[str, Any] = {name: np.ascontiguousarray(getattr(self, name)[rows]) for name in columns}
        return replace(self, **chosen)

    def predicted(self, parameters: np.ndarray, earth: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Outputs (M, N), derivatives by parameters (M, N, 6) and by the Sun vector (M, N, 3)."""
        shape = self.voltages.shape
        out, slopes, turns = np.empty(shape), np.empty((*shape, 6)), np.empty((*shape, 3))
        _predict(
            self.response, self.normals_b, np.ascontiguousarray(parameters), float(earth), self.sun_b, self.intensity,
            self.seen, self.albedo, self.warmth, out, slopes, turns,
        )  # fmt: skip
        return out, slopes, turns


_predict = typed_call(predict_cells)


def sun_in_view(recorded: Recorded, sun_b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether cells see the Sun (M, N) by the mission's views, and whether it is surely so, (M, N)."""
    values = recorded.mission.values
    normals_b = np.asarray(values.cells.normals, dtype=np.float64)
    cosine = np.clip(sun_b @ normals_b.T, -1.0, 1.0)
    angle = np.degrees(np.arccos(cosine))
    own = own_view_cosines(values)
    cosines = own if len(own) else np.array([half_view_cosine(values)])
    half = np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))
    seen = angle <= half
    sure = np.abs(angle - half) > EDGE_DEG
    sides = plane_sides(values)
    above = sun_b @ np.asarray(values.cells.clip_normal, dtype=np.float64)
    clipped = sides != 0.0
    seen &= ~clipped | (sides * above[:, None] > 0.0)
    sure &= ~clipped | (np.abs(above) > math.sin(math.radians(_PLANE_DEG)))[:, None]
    # away from every view nothing is in doubt
    sure |= angle > half + EDGE_DEG
    masks = blocked_directions(values)
    if len(masks):
        where = np.array([grid_cell.py_func(tuple(s)) if np.isfinite(s).all() else 0 for s in sun_b.tolist()])
        hidden = (masks[where][:, None] >> np.arange(len(normals_b), dtype=np.uint32) & 1).astype(bool)
        seen &= ~hidden
    return seen, sure


def cell_data(
    recorded: Recorded,
    around: Surroundings,
    sun_b: np.ndarray,
    dcm_bn: np.ndarray | None,
    response: Response,
    reference_temperature: float,
    parameters: np.ndarray | None = None,
) -> CellData:
    """The outputs of a recording with the light on them.

    Args:
        sun_b: (M, 3), NaN where unknown.
        dcm_bn: (M, 3, 3) for the light of the Earth; None: nobody knows it.
        parameters: (N, 5) best known so far, for the normals that the Earth shines on.
    """
    normals_b = np.ascontiguousarray(recorded.mission.values.cells.normals, dtype=np.float64)
    known = np.isfinite(sun_b).all(axis=1)
    sun_b = np.where(known[:, None], sun_b, (0.0, 0.0, 1.0))
    seen, sure = sun_in_view(recorded, sun_b)
    gone = around.shadow > _GONE
    whole = (around.shadow < _WHOLE) & known
    seen &= whole[:, None]
    read = np.isfinite(recorded.voltages) & ~recorded.saturated
    usable = read & ((whole[:, None] & sure) | gone[:, None])
    at_edge = read & whole[:, None] & ~sure
    earth_known = dcm_bn is not None and recorded.r_n is not None
    albedo = np.zeros_like(recorded.voltages)
    if dcm_bn is not None and recorded.r_n is not None:
        normals = normals_b if parameters is None else normals_of(normals_b, parameters)
        albedo = earth_light(recorded, around, dcm_bn, normals)
        placed = np.isfinite(dcm_bn).all(axis=(1, 2))
        usable &= (placed | gone)[:, None]
        at_edge &= placed[:, None]
    turned = np.zeros(len(sun_b)) if dcm_bn is None else _turned(dcm_bn)
    warmth = np.zeros(len(sun_b))
    if recorded.temperature is not None:
        warmth = recorded.temperature - reference_temperature
    voltages = np.where(np.isfinite(recorded.voltages), recorded.voltages, 0.0)
    return CellData(
        normals_b, voltages, np.ascontiguousarray(sun_b), np.where(gone, 0.0, around.intensity), seen, usable,
        at_edge, albedo, warmth, recorded.time, turned, response, earth_known,
    )  # fmt: skip


def _turned(dcm_bn: np.ndarray) -> np.ndarray:
    """(M,) sum of the angles [rad] between successive attitudes (M, 3, 3)."""
    trace = np.einsum("kij,kij->k", dcm_bn[1:], dcm_bn[:-1])
    angles = np.arccos(np.clip(0.5 * (trace - 1.0), -1.0, 1.0))
    return np.concatenate([np.zeros(1), np.cumsum(np.nan_to_num(angles))])
