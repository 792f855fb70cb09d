# SPDX-License-Identifier: Apache-2.0
"""Light of the Earth that a mission asks for: which model, which reflectivity, and whether a case draws its own."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from css_common.declared import builder, given, made, table_of
from css_common.random_streams import RandomKey
from css_common.schema import Values, choice, flag, real, text
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


def conflicts(values: Values) -> Iterator[str]:
    """What is wrong between the values, one message each."""
    albedo = parameters(values)
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
