# SPDX-License-Identifier: Apache-2.0
"""Light of the Earth that a mission asks for: which model, which reflectivity, and whether a case draws its own."""

import math
from collections.abc import Iterator

import numpy as np

from css_common.random_streams import RandomKey
from css_common.schema import Table, Values, choice, flag, real, text
from css_environment.moving_clouds import (
    COMMON,
    CORRELATED,
    PER_CELL,
    CloudMotion,
    Clouds,
    draw_fields,
    draw_motion,
    fields_needed,
    likeness,
)
from css_environment.reflectivity import (
    Reflectivity,
    draw_correlated,
    draw_reflectivity,
    named_reflectivity,
    read_reflectivity,
    zonal_reflectivity,
)

_KINDS = {"common": COMMON, "per_cell": PER_CELL, "correlated": CORRELATED}
_MOST_FIELDS = 500
_SECONDS_PER_HOUR = 3600.0

PARAMETERS: Table = (
    flag("albedo.enabled", True, "light that the Earth reflects onto the cells (O'Keefe & Schaub 2013, Eq. 17)"),
    choice(
        "albedo.model",
        "patches",
        ("patches", "vector", "nadir"),
        "light of the visible sunlit Earth by patches, as one vector (Benton), or constant from nadir",
    ),
    choice(
        "albedo.reflectivity",
        "zonal",
        ("zonal", "knocke", "constant", "file"),
        "annual means by latitude, seasonal model by latitude, one value, or a grid from files",
    ),
    real("albedo.constant", 0.3, "-", "the one value", low=0.0, high=1.0),
    text("albedo.mean_file", "", "comma-separated fractions, rows from south to north, columns from 180 deg west"),
    text("albedo.std_file", "", "standard deviations on the same grid; empty: none"),
    choice(
        "albedo.draw",
        "mean",
        ("mean", "common", "per_cell", "correlated"),
        "means as they are, or drawn once per case: one draw for the whole Earth, one for each cell of the grid, or "
        "draws that are alike over an angle",
    ),
    real("albedo.correlation_deg", 15.0, "deg", "that angle, at the centre of the Earth", low=2.5, high=90.0),
    real(
        "albedo.drift_m_s",
        0.0,
        "m/s",
        "speed of the clouds over the ground at the equator, eastward",
        low=-200.0,
        high=200.0,
    ),
    real("albedo.drift_spread_m_s", 0.0, "m/s", "1 sigma of the cases about it", low=0.0, high=100.0),
    real(
        "albedo.renewal_h",
        0.0,
        "h",
        "time after which clouds have become others (correlation 0.32); 0: they stay as they are",
        low=0.0,
        high=1e4,
    ),
    real("albedo.factor", 1.0, "-", "multiplies all reflectivities", low=0.0, high=10.0),
    real("albedo.limit", 1.0, "-", "reflectivities are cut to this", low=0.0, high=1.0),
)


def source(values: Values, epoch_ns: int) -> Reflectivity:
    """Means and standard deviations before any draw.

    Raises:
        ValueError: a file is missing or wrong.
    """
    albedo = values.albedo
    if albedo.reflectivity == "zonal" and albedo.draw in ("per_cell", "correlated"):
        return zonal_reflectivity()  # columns matter only to independent draws
    if albedo.reflectivity != "file":
        return named_reflectivity(albedo.reflectivity, albedo.constant, epoch_ns)
    return read_reflectivity(albedo.mean_file, albedo.std_file or None)


def case_reflectivity(values: Values, grid: Reflectivity, key: RandomKey) -> np.ndarray:
    """Reflectivities (rows, columns) of one case [-]."""
    albedo = values.albedo
    drawn = np.array(grid.mean)
    if albedo.draw == "correlated":
        drawn = draw_correlated(grid, key, math.radians(albedo.correlation_deg))
    elif albedo.draw != "mean":
        draw_reflectivity(grid, key, albedo.draw == "common", drawn)
    return np.minimum(albedo.factor * drawn, albedo.limit)


def clouds_move(values: Values) -> bool:
    """Whether reflectivities change in a flight."""
    albedo = values.albedo
    return albedo.drift_m_s != 0.0 or albedo.drift_spread_m_s > 0.0 or albedo.renewal_h > 0.0


def clouds(values: Values, grid: Reflectivity | None) -> Clouds:
    """What the clouds of all cases have in common; `grid` of `source`, None without light of the Earth."""
    if grid is None or not clouds_move(values):
        return Clouds(False, np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(0), 1.0, 1.0)
    albedo = values.albedo
    alike = likeness(grid, _KINDS[albedo.draw], math.radians(albedo.correlation_deg))
    return Clouds(True, np.array(grid.mean), np.array(grid.std), alike, albedo.factor, albedo.limit)


def case_clouds(values: Values, grid: Reflectivity, key: RandomKey) -> tuple[CloudMotion, np.ndarray]:
    """Motion and fields (F, rows, columns) of the clouds of one case."""
    albedo, interval_s = values.albedo, _SECONDS_PER_HOUR * values.albedo.renewal_h
    count = fields_needed(interval_s, values.mission.duration)
    fields = draw_fields(grid, key, _KINDS[albedo.draw], math.radians(albedo.correlation_deg), count)
    columns = grid.mean.shape[1]
    return draw_motion(key, columns, albedo.drift_m_s, albedo.drift_spread_m_s, interval_s), fields


def _motion_conflicts(values: Values) -> Iterator[str]:
    albedo = values.albedo
    moved = [key for key in ("drift_m_s", "drift_spread_m_s") if getattr(albedo, key) != 0.0]
    if moved and albedo.draw not in ("per_cell", "correlated"):
        yield f"albedo.{moved[0]}: given with albedo.draw {albedo.draw}, expected per_cell or correlated, which drift"
    if albedo.renewal_h <= 0.0:
        return
    if albedo.draw == "mean":
        yield "albedo.renewal_h: given with albedo.draw mean, expected draws, which are renewed"
    least = values.mission.duration / _SECONDS_PER_HOUR / _MOST_FIELDS
    if albedo.renewal_h < least:
        yield (
            f"albedo.renewal_h: {albedo.renewal_h:g} given, expected at least {least:.3g}: a flight of "
            f"{values.mission.duration:g} s sees at most {_MOST_FIELDS} kinds of clouds"
        )


def conflicts(values: Values) -> Iterator[str]:
    """What is wrong between the values, one message each."""
    albedo = values.albedo
    yield from _motion_conflicts(values)
    if albedo.model == "nadir" and albedo.reflectivity != "constant":
        yield f"albedo.reflectivity: {albedo.reflectivity} given, but light from nadir is constant; expected constant"
    if albedo.reflectivity == "file":
        if not albedo.mean_file:
            yield "albedo.mean_file: missing, expected a file because albedo.reflectivity is file"
            return
        try:
            source(values, 0)
        except (OSError, ValueError) as error:
            yield f"albedo.mean_file: {error}"
    elif albedo.draw != "mean" and albedo.reflectivity in ("knocke", "constant"):
        yield f"albedo.draw: {albedo.draw} given, but {albedo.reflectivity} has no standard deviations; expected mean"
