# SPDX-License-Identifier: Apache-2.0
"""Reflectivity of the Earth on a latitude-longitude grid: built-in models, files and random draws.

A grid is a (rows, columns) array of fractions: rows from south to north, columns from west to east beginning at
180 deg west, cells of equal size in latitude and longitude, values at cell centres, constant within a cell. A model
that knows only latitude has one column, one that is constant a single cell.
"""

import csv
import math
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from css_common.file_text import decoded
from css_common.kernel import kernel
from css_common.random_streams import RandomKey, Stream, normal4
from css_common.vectors import Vec3
from css_environment.time_scales import utc_date

LOWEST, HIGHEST = 0.05, 1.0
"""Limits of drawn reflectivities."""

# Zonal means and standard deviations of the Earth's reflectivity at 380 nm in percent, 5 deg bands from north to
# south: NASA Total Ozone Mapping Spectrometer, daily 2000 to 2005, the data of O'Keefe & Schaub 2013, Fig. 4.
_ZONAL_MEAN = (
    85.5, 79.2, 69.8, 61.0, 53.0, 46.0, 42.3, 40.3, 36.7, 32.3, 28.5, 24.4, 21.4, 18.5, 17.7, 19.0, 26.0, 23.7,
    22.4, 22.4, 21.3, 19.9, 20.4, 22.1, 25.2, 29.6, 33.8, 37.3, 39.1, 41.2, 49.9, 70.5, 84.7, 87.3, 90.3, 91.8,
)  # fmt: skip
_ZONAL_STD = (
    6.6, 10.3, 15.2, 21.1, 23.4, 21.8, 21.0, 21.7, 23.1, 21.3, 20.5, 18.2, 15.6, 13.7, 13.6, 15.5, 19.3, 16.8,
    15.5, 16.0, 15.1, 14.1, 15.2, 16.7, 18.3, 19.2, 19.5, 19.4, 18.5, 18.2, 19.3, 15.7, 7.6, 4.6, 2.6, 2.4,
)  # fmt: skip


class Reflectivity(NamedTuple):
    """Mean and standard deviation of each cell [-], (rows, columns) both."""

    mean: np.ndarray
    std: np.ndarray


def zonal_reflectivity(columns: int = 72) -> Reflectivity:
    """Annual means of 5 deg bands from satellite data; equal columns, so that cells can be drawn independently."""
    mean, std = (np.array(values)[::-1, None] / 100.0 for values in (_ZONAL_MEAN, _ZONAL_STD))
    return Reflectivity(np.tile(mean, (1, columns)), np.tile(std, (1, columns)))


def constant_reflectivity(value: float) -> Reflectivity:
    """The same value everywhere."""
    return Reflectivity(np.full((1, 1), float(value)), np.zeros((1, 1)))


def named_reflectivity(name: str, constant: float, epoch_ns: int) -> Reflectivity:
    """The built-in model `zonal` (of one column), `knocke` at an epoch (UTC, ns), or `constant` everywhere."""
    if name == "zonal":
        return zonal_reflectivity(1)
    return knocke_reflectivity(epoch_ns) if name == "knocke" else constant_reflectivity(constant)


def knocke_reflectivity(epoch_ns: int, rows: int = 36) -> Reflectivity:
    """Seasonal zonal model of Knocke, Ries & Tapley 1988 (also ECSS-E-ST-10-04C, annex F) at an epoch (UTC, ns)."""
    days, fraction = utc_date(epoch_ns)
    season = math.cos(2.0 * math.pi * (days + float(fraction) - 2_444_960.5) / 365.25)  # from 22 December 1981
    sine = np.sin(np.radians((np.arange(rows) + 0.5) * 180.0 / rows - 90.0))
    mean = 0.34 + 0.10 * season * sine + 0.29 * (3.0 * sine**2 - 1.0) / 2.0
    return Reflectivity(mean[:, None], np.zeros((rows, 1)))


def read_reflectivity(mean_file: str | Path, std_file: str | Path | None = None) -> Reflectivity:
    """Grid from comma-separated files of fractions, any number of equal rows.

    Raises ValueError naming file, row and column (from 1) of what is wrong.
    """
    mean = _read_grid(Path(mean_file))
    if std_file is None:
        return Reflectivity(mean, np.zeros_like(mean))
    std = _read_grid(Path(std_file))
    if std.shape != mean.shape:
        raise ValueError(f"{std_file}: {std.shape} rows and columns, but {mean_file} has {mean.shape}")
    return Reflectivity(mean, std)


def _read_grid(file: Path) -> np.ndarray:
    try:
        text = decoded(file.read_bytes())
    except ValueError as error:
        raise ValueError(f"{file}: cannot be read: {error}") from error
    lines = [(number, row) for number, row in enumerate(csv.reader(text.splitlines()), 1) if "".join(row).strip()]
    if not lines:
        raise ValueError(f"{file}: no values, expected rows of fractions from south to north")
    grid = np.empty((len(lines), len(lines[0][1])))
    for i, (number, row) in enumerate(lines):
        if len(row) != grid.shape[1]:
            raise ValueError(f"{file}, row {number}: {len(row)} columns, expected {grid.shape[1]} as in the first row")
        for j, text in enumerate(row):
            try:
                grid[i, j] = float(text)
            except ValueError:
                raise ValueError(f"{file}, row {number}, column {j + 1}: '{text}' is not a number") from None
            if not 0.0 <= grid[i, j] <= 1.0:
                raise ValueError(f"{file}, row {number}, column {j + 1}: {text} is not a fraction from 0 to 1")
    return grid


@kernel
def draw_reflectivity(reflectivity: Reflectivity, key: RandomKey, common: bool, values_out) -> None:
    """Draw a grid for one case: mean + std N(0, 1), limited to `LOWEST` and `HIGHEST`.

    `common` takes one draw for the whole Earth, else each cell has its own; `values_out` is (rows, columns).
    """
    draws = normal4(key, Stream.ALBEDO, 0, 0)
    common_draw = draws[0]
    columns = values_out.shape[1]
    for cell in range(values_out.size):
        if not common and cell % 4 == 0:
            draws = normal4(key, Stream.ALBEDO, 1, cell // 4)
        draw = common_draw if common else draws[cell % 4]
        i, j = cell // columns, cell % columns
        values_out[i, j] = min(HIGHEST, max(LOWEST, reflectivity.mean[i, j] + reflectivity.std[i, j] * draw))


@kernel
def draws_of_cells(key: RandomKey, number: int, out) -> None:
    """(N,) independent normal draws of a field; number 0 has those of `draw_reflectivity`."""
    for cell in range(out.shape[0]):
        out[cell] = normal4(key, Stream.ALBEDO, 1 + number, cell // 4)[cell % 4]


def draw_correlated(reflectivity: Reflectivity, key: RandomKey, length: float) -> np.ndarray:
    """As `draw_reflectivity` draws each cell, with draws alike over an angle: (rows, columns).

    Draws of two cells an angle a apart have the correlation exp(-a^2 / (2 length^2)).

    Args:
        length: [rad] at the centre of the Earth.
    """
    rows, columns = reflectivity.mean.shape
    draws = np.zeros(rows * columns)
    draws_of_cells(key, 0, draws)
    field = (smoothing(rows, columns, length) @ draws).reshape(rows, columns)
    return np.clip(reflectivity.mean + reflectivity.std * field, LOWEST, HIGHEST)


@lru_cache(maxsize=2)
def smoothing(rows: int, columns: int, length: float) -> np.ndarray:
    """(cells, cells) weights of independent draws, of unit norm for each cell: equal areas count equally."""
    latitude = np.pi * ((np.arange(rows) + 0.5) / rows - 0.5)
    longitude = 2.0 * np.pi * ((np.arange(columns) + 0.5) / columns - 0.5)
    lat, lon = (a.ravel() for a in np.meshgrid(latitude, longitude, indexing="ij"))
    directions = np.column_stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    angle = np.arccos(np.clip(directions @ directions.T, -1.0, 1.0))
    weights = np.sqrt(np.cos(lat)) * np.exp(-((angle / length) ** 2))
    return weights / np.linalg.norm(weights, axis=1, keepdims=True)


@kernel
def cell_at(x: float, y: float, z: float, rows: int, columns: int) -> int:
    """Number (row * columns + column) of the grid cell in the Earth-fixed direction (x, y, z), a unit vector.

    Latitude is geocentric. Latitude and longitude are good to 1e-5 rad.
    """
    row = int((_arc(math.sqrt(x * x + y * y), z) / math.pi + 0.5) * rows)
    column = int((_arc(x, y) / (2.0 * math.pi) + 0.5) * columns)
    return min(max(row, 0), rows - 1) * columns + min(max(column, 0), columns - 1)


@kernel
def reflectivity_at(reflectivity, direction_e: Vec3) -> float:
    """Reflectivity in an Earth-fixed direction, a unit vector, interpolated in latitude between the grid's rows.

    Args:
        reflectivity: (rows, columns) grid.
    """
    rows, columns = reflectivity.shape
    x, y, z = direction_e
    in_rows = (_arc(math.sqrt(x * x + y * y), z) / math.pi + 0.5) * rows - 0.5
    column = cell_at(x, y, z, rows, columns) % columns
    south = min(max(math.floor(in_rows), 0), rows - 1)
    north = min(south + 1, rows - 1)
    part = min(max(in_rows - south, 0.0), 1.0)
    return reflectivity[south, column] + part * (reflectivity[north, column] - reflectivity[south, column])


@kernel
def _arc(x: float, y: float) -> float:
    """Angle of (x, y) from the x axis to 1e-5 rad, three times faster than atan2 (Abramowitz & Stegun, 4.4.49)."""
    short, long = min(abs(x), abs(y)), max(abs(x), abs(y), 1e-300)
    q = short / long
    q2 = q * q
    angle = q * (0.9998660 + q2 * (-0.3302995 + q2 * (0.1801410 + q2 * (-0.0851330 + q2 * 0.0208351))))
    if abs(y) > abs(x):
        angle = 0.5 * math.pi - angle
    if x < 0.0:
        angle = math.pi - angle
    return -angle if y < 0.0 else angle
