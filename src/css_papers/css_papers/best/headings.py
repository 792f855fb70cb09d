# SPDX-License-Identifier: Apache-2.0
"""What every Sun estimator makes of every layout, with the Sun in all directions and the spacecraft at rest.

There is no light of the Earth, and the cells are ideal but for noise that is asked for: what is left is the estimator's
own choice of cells, and what the layout cannot show.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from css_common.kernel import typed_call
from css_common.mission import MissionError, load_mission
from css_common.vectors import vector_of
from css_estimation.sun.cell_layout import CellLayout, cell_layout, sees
from css_estimation.sun.sun_estimator import SunEstimator
from css_estimation.sun.sun_heading import PREDICTION_SUNLIT, UNAIDED, VALIDITY_VALID
from css_papers.best.layouts import layouts
from css_papers.best.scenarios import MISSION

_SEED = 1
_PERIOD = 0.1  # [s]
AT_REST = UNAIDED._replace(gyro_valid=True, sky=UNAIDED.sky._replace(predicted=PREDICTION_SUNLIT))


class Headings(NamedTuple):
    """Of one estimator on one layout, after some cycles with the Sun in each of K directions."""

    error_deg: np.ndarray  # (K,) angle of estimated to true Sun; NaN without an estimate
    valid: np.ndarray  # (K,) bool, cells of the last cycle gave the estimate
    sun_b: np.ndarray  # (K, 3) estimated
    covariance: np.ndarray  # (K, 9) [-] of it, row-major; first element -1: not estimated


class ErrorsOverTheSky(NamedTuple):
    """What is told of them; angles are over the directions with a valid estimate, None without any."""

    mean_deg: float | None
    p95_deg: float | None
    worst_deg: float | None
    not_valid: float  # share of the directions


def all_layouts() -> dict[str, Mapping[str, str]]:
    """By name, the settings that give a mission these cells: the dual pyramid of O'Keefe & Schaub, and all others."""
    return {"dual pyramid": {}} | {name: layout.settings for name, layout in layouts().items()}


def directions(count: int) -> np.ndarray:
    """Unit vectors (K, 3) that share the sphere evenly: a spiral with the golden angle (Swinbank & Purser 2006)."""
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    azimuth = k * math.pi * (3.0 - math.sqrt(5.0))
    across = np.sqrt(1.0 - z * z)
    return np.column_stack([across * np.cos(azimuth), across * np.sin(azimuth), z])


def values_of(kind: type[SunEstimator], layout: str) -> Any:
    """Values of an estimator on a layout by name, told nothing else; None where it refuses the layout."""
    settings = dict(all_layouts()[layout])
    try:
        mission = load_mission(MISSION, [f"{key}={value}" for key, value in settings.items()])
        return mission.node_of(kind, "estimator").values
    except MissionError:
        return None


def outputs_of(layout: CellLayout, sun_b: np.ndarray) -> np.ndarray:
    """Outputs (N,) of ideal cells: cosines, where the Sun is in view."""
    cells = layout.cells
    cosines = np.column_stack([cells["nx"], cells["ny"], cells["nz"]]) @ sun_b
    seen = [sees(layout, i, vector_of(sun_b)) for i in range(len(cells))]
    return np.where(seen, np.maximum(cosines, 0.0), 0.0)


def headings(
    kind: type[SunEstimator], layout: str, sun_b: np.ndarray, noise: float = 0.0, cycles: int = 100
) -> Headings | None:
    """What an estimator, begun anew for each direction, comes to; None where it refuses the layout.

    Args:
        layout: one of `all_layouts`.
        sun_b: (K, 3) unit vectors to the Sun.
        noise: of each output, 1 sigma [-]; what is below zero is not cut off.
        cycles: of 0.1 s, for those that have to converge.
    """
    values = values_of(kind, layout)
    if values is None:
        return None
    algorithm, known = kind.algorithm, cell_layout(values)
    p, step = algorithm.parameters(values), typed_call(algorithm.step)
    rng = np.random.default_rng(_SEED)
    count = len(sun_b)
    result = Headings(np.full(count, np.nan), np.zeros(count, bool), np.zeros((count, 3)), np.zeros((count, 9)))
    for k, sun in enumerate(sun_b):
        state, memory, ideal = algorithm.initial_state(p), algorithm.initial_memory(p), outputs_of(known, sun)
        for _ in range(cycles):
            voltages = ideal + noise * rng.standard_normal(len(ideal)) if noise else ideal.copy()
            state, heading = step(p, state, memory, _PERIOD, voltages, AT_REST)
        estimated = np.array(heading.sun_b)
        result.valid[k] = heading.validity == VALIDITY_VALID
        result.sun_b[k], result.covariance[k] = estimated, heading.covariance
        if np.any(estimated):
            sine, cosine = np.linalg.norm(np.cross(estimated, sun)), estimated @ sun
            result.error_deg[k] = math.degrees(math.atan2(sine, cosine))
    return result


def over_the_sky(found: Headings) -> ErrorsOverTheSky:
    """Mean, 95 %, worst, and what was not valid."""
    error = found.error_deg[found.valid]
    not_valid = 1.0 - float(np.mean(found.valid))
    if not len(error):
        return ErrorsOverTheSky(None, None, None, not_valid)
    return ErrorsOverTheSky(float(error.mean()), float(np.percentile(error, 95.0)), float(error.max()), not_valid)
