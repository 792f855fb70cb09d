# SPDX-License-Identifier: Apache-2.0
"""Light of the Earth that a mission asks for: which model, which reflectivity, and whether a case draws its own."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from css_common.declared import builder, given, made, table_of
from css_common.mission_section import DURATION
from css_common.random_streams import RandomKey
from css_common.schema import Values, choice, flag, real, text
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

ENABLED = flag("albedo.enabled", True, "light that the Earth reflects onto the cells (O'Keefe & Schaub 2013, Eq. 17)")
MODEL = choice(
    "albedo.model",
    "patches",
    ("patches", "vector", "nadir"),
    "light of the visible sunlit Earth by patches, as one vector (Benton), or constant from nadir",
)
DRIFT = real(
    "albedo.drift_m_s",
    0.0,
    "m/s",
    "speed of the clouds over the ground at the equator, eastward",
    low=-200.0,
    high=200.0,
)
DRIFT_SPREAD = real("albedo.drift_spread_m_s", 0.0, "m/s", "1 sigma of the cases about it", low=0.0, high=100.0)
RENEWAL = real(
    "albedo.renewal_h",
    0.0,
    "h",
    "time after which clouds have become others (correlation 0.32); 0: they stay as they are",
    low=0.0,
    high=1e4,
)

_KINDS = {"common": COMMON, "per_cell": PER_CELL, "correlated": CORRELATED}
_MOST_FIELDS = 500
_SECONDS_PER_HOUR = 3600.0


def _seconds(hours: float) -> float:
    return _SECONDS_PER_HOUR * hours


class Earthlight(NamedTuple):
    """Which light of the Earth a mission asks for."""

    enabled: bool = given(ENABLED)
    model: str = given(MODEL)
    reflectivity: str = given(
        choice(
            "albedo.reflectivity",
            "zonal",
            ("zonal", "knocke", "constant", "file"),
            "annual means by latitude, seasonal model by latitude, one value, or a grid from files",
        )
    )
    constant: float = given(real("albedo.constant", 0.3, "-", "the one value", low=0.0, high=1.0))
    mean_file: str = given(
        text("albedo.mean_file", "", "comma-separated fractions, rows from south to north, columns from 180 deg west")
    )
    std_file: str = given(text("albedo.std_file", "", "standard deviations on the same grid; empty: none"))
    draw: str = given(
        choice(
            "albedo.draw",
            "mean",
            ("mean", "common", "per_cell", "correlated"),
            "means as they are, or drawn once per case: one draw for the whole Earth, one for each cell of the grid, "
            "or draws that are alike over an angle",
        )
    )
    correlation: float = made(  # [rad]
        math.radians,
        real("albedo.correlation_deg", 15.0, "deg", "that angle, at the centre of the Earth", low=2.5, high=90.0),
    )
    drift: float = given(DRIFT)  # [m/s]
    drift_spread: float = given(DRIFT_SPREAD)  # [m/s]
    renewal: float = made(_seconds, RENEWAL)  # [s]
    factor: float = given(real("albedo.factor", 1.0, "-", "multiplies all reflectivities", low=0.0, high=10.0))
    limit: float = given(real("albedo.limit", 1.0, "-", "reflectivities are cut to this", low=0.0, high=1.0))


PARAMETERS = table_of(Earthlight)
parameters = builder(Earthlight)


def source(values: Values, epoch_ns: int) -> Reflectivity:
    """Means and standard deviations before any draw.

    Raises:
        ValueError: a file is missing or wrong.
    """
    albedo = parameters(values)
    if albedo.reflectivity == "zonal" and albedo.draw in ("per_cell", "correlated"):
        return zonal_reflectivity()  # columns matter only to independent draws
    if albedo.reflectivity != "file":
        return named_reflectivity(albedo.reflectivity, albedo.constant, epoch_ns)
    return read_reflectivity(albedo.mean_file, albedo.std_file or None)


def case_reflectivity(values: Values, grid: Reflectivity, key: RandomKey) -> np.ndarray:
    """Reflectivities (rows, columns) of one case [-]."""
    albedo = parameters(values)
    drawn = np.array(grid.mean)
    if albedo.draw == "correlated":
        drawn = draw_correlated(grid, key, albedo.correlation)
    elif albedo.draw != "mean":
        draw_reflectivity(grid, key, albedo.draw == "common", drawn)
    return np.minimum(albedo.factor * drawn, albedo.limit)


def clouds_move(values: Values) -> bool:
    """Whether reflectivities change in a flight."""
    albedo = parameters(values)
    return albedo.drift != 0.0 or albedo.drift_spread > 0.0 or albedo.renewal > 0.0


def clouds(values: Values, grid: Reflectivity | None) -> Clouds:
    """What the clouds of all cases have in common; `grid` of `source`, None without light of the Earth."""
    if grid is None or not clouds_move(values):
        return Clouds(False, np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(0), 1.0, 1.0)
    albedo = parameters(values)
    alike = likeness(grid, _KINDS[albedo.draw], albedo.correlation)
    return Clouds(True, np.array(grid.mean), np.array(grid.std), alike, albedo.factor, albedo.limit)


def case_clouds(values: Values, grid: Reflectivity, key: RandomKey) -> tuple[CloudMotion, np.ndarray]:
    """Motion and fields (F, rows, columns) of the clouds of one case."""
    albedo = parameters(values)
    count = fields_needed(albedo.renewal, values[DURATION])
    fields = draw_fields(grid, key, _KINDS[albedo.draw], albedo.correlation, count)
    return draw_motion(key, grid.mean.shape[1], albedo.drift, albedo.drift_spread, albedo.renewal), fields


def _motion_conflicts(values: Values) -> Iterator[str]:
    albedo = parameters(values)
    moved = [parameter.name for parameter in (DRIFT, DRIFT_SPREAD) if values[parameter] != 0.0]
    if moved and albedo.draw not in ("per_cell", "correlated"):
        yield f"{moved[0]}: given with albedo.draw {albedo.draw}, expected per_cell or correlated, which drift"
    if albedo.renewal <= 0.0:
        return
    if albedo.draw == "mean":
        yield "albedo.renewal_h: given with albedo.draw mean, expected draws, which are renewed"
    least = values[DURATION] / _SECONDS_PER_HOUR / _MOST_FIELDS
    if values[RENEWAL] < least:
        yield (
            f"albedo.renewal_h: {values[RENEWAL]:g} given, expected at least {least:.3g}: a flight of "
            f"{values[DURATION]:g} s sees at most {_MOST_FIELDS} kinds of clouds"
        )


def conflicts(values: Values) -> Iterator[str]:
    """What is wrong between the values, one message each."""
    albedo = parameters(values)
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
