# SPDX-License-Identifier: Apache-2.0
"""Numbers that describe a coverage map: how many cells see the Sun, where none does, how wrong the average is."""

from typing import Any, NamedTuple

import numpy as np

from css_monte_carlo.coverage import CellMap, Grid

LARGE_ERROR_DEG = 30.0
"""An error beyond it points the arrays away from power positive (O'Keefe & Schaub 2013)."""
SMALL_ERROR_DEG = 10.0
CONES_DEG = (10.0, 15.0, 19.0, 20.0, 30.0, 45.0, 60.0, 75.0)
"""Half angles of the cones about the array normal whose largest errors are reported."""


class Hole(NamedTuple):
    """A connected region of directions that no cell sees."""

    centre_b: tuple[float, float, float]  # unit vector of its middle in b
    fraction: float  # of the sphere
    solid_angle_sr: float
    half_angle_deg: float  # of a cone of the same solid angle


class WavgErrors(NamedTuple):
    """Errors of the weighted average over the sphere; polar angles are from the array normal."""

    mean_deg: float | None  # over the directions with an estimate; None: there are none
    max_deg: float
    fraction_above_30: float  # of the sphere
    polar_max_above_30: tuple[float, float] | None  # [deg] first and last ring with its largest error above 30 deg
    polar_mean_above_30: tuple[float, float] | None  # the same for the mean of the ring
    polar_all_above_30: tuple[float, float] | None  # the same for all of the ring
    max_within_deg: dict[str, float]  # half angle of a cone about the array normal to the largest error in it
    first_polar_above_10: float | None  # [deg] smallest polar angle with an error above 10 deg


def seen_fractions(grid: Grid, result: CellMap) -> list[float]:
    """Fraction of the sphere seen by 0, 1, 2, ... cells, up to the largest number that occurs."""
    most = int(result.seen_by.max())
    share = grid.ring_weight / len(grid.azimuth)
    return [float(share @ np.count_nonzero(result.seen_by == count, axis=1)) for count in range(most + 1)]


def holes(grid: Grid, result: CellMap) -> list[Hole]:
    """Regions that no cell sees, the largest first; smaller ones than a cell of the grid are not found."""
    from scipy import ndimage  # slow to load, and studies read this module without it

    labels, count = ndimage.label(result.seen_by == 0)
    # the map is cut open along one meridian and at the poles: join what touches there
    joined = np.arange(count + 1)
    seam = [(a, b) for a, b in zip(labels[:, 0], labels[:, -1], strict=True) if a and b]
    for ring in (labels[0], labels[-1]):
        at_pole = np.unique(ring[ring > 0])
        seam += [(at_pole[0], other) for other in at_pole[1:]]
    for a, b in seam:
        joined[joined == joined[b]] = joined[a]
    regions = joined[labels]
    share = np.broadcast_to(grid.ring_weight[:, None] / len(grid.azimuth), labels.shape)
    found = []
    for region in np.unique(regions[labels > 0]):
        inside = regions == region
        fraction = float(share[inside].sum())
        polar, azimuth = (axis[index] for axis, index in zip(grid[:2], np.nonzero(inside), strict=True))
        at = np.array([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)])
        middle = np.array(grid.axes).T @ (at @ share[inside])
        length = np.linalg.norm(middle)
        # a belt around the body has no middle
        x, y, z = middle / length if length > 1e-9 * fraction else np.zeros(3)
        half_angle = np.degrees(np.arccos(1.0 - 2.0 * fraction))
        found.append(Hole((float(x), float(y), float(z)), fraction, 4.0 * np.pi * fraction, float(half_angle)))
    return sorted(found, key=lambda hole: -hole.fraction)


def wavg_errors(grid: Grid, result: CellMap) -> WavgErrors:
    """Statistics of the error map."""
    error = np.degrees(result.wavg_error)
    polar = np.degrees(grid.polar)
    known = ~np.isnan(error)
    weight = np.where(known, grid.ring_weight[:, None], 0.0)
    filled = np.where(known, error, 0.0)
    large = filled > LARGE_ERROR_DEG
    rings = known.any(axis=1)
    ring_mean = np.where(rings, filled.sum(axis=1) / np.maximum(known.sum(axis=1), 1), 0.0)

    def extent(chosen: np.ndarray) -> tuple[float, float] | None:
        return (float(polar[chosen][0]), float(polar[chosen][-1])) if chosen.any() else None

    above_small = polar[(filled > SMALL_ERROR_DEG).any(axis=1)]
    within = {f"{cone:g}": polar <= cone for cone in CONES_DEG}
    return WavgErrors(
        mean_deg=float((filled * weight).sum() / weight.sum()) if known.any() else None,
        max_deg=float(filled.max()),
        fraction_above_30=float(grid.ring_weight @ large.mean(axis=1)),
        polar_max_above_30=extent(np.any(large, axis=1)),
        polar_mean_above_30=extent(ring_mean > LARGE_ERROR_DEG),
        polar_all_above_30=extent(np.all(large, axis=1)),
        max_within_deg={cone: float(filled[chosen].max()) for cone, chosen in within.items()},
        first_polar_above_10=float(above_small[0]) if len(above_small) else None,
    )


def coverage_object(grid: Grid, ideal: CellMap, warped: CellMap) -> dict[str, Any]:
    """All numbers as plain data, ready for JSON."""
    return {
        "grid": [len(grid.polar), len(grid.azimuth)],
        "seen_by_fraction": seen_fractions(grid, ideal),
        "holes": [hole._asdict() for hole in holes(grid, ideal)],
        "wavg_ideal": wavg_errors(grid, ideal)._asdict(),
        "wavg_warped": wavg_errors(grid, warped)._asdict(),
    }
