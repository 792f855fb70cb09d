# SPDX-License-Identifier: Apache-2.0
"""Reflectivity grids: published means, files and their errors, draws, and the lookup."""

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from css_common.random_streams import random_key
from css_environment.reflectivity import (
    Reflectivity,
    cell_at,
    constant_reflectivity,
    draw_correlated,
    draw_reflectivity,
    knocke_reflectivity,
    read_reflectivity,
    zonal_reflectivity,
)


def area_mean(grid):
    edges = np.sin(np.radians(np.linspace(-90, 90, len(grid) + 1)))
    return np.average(grid.mean(axis=1), weights=np.diff(edges))


def test_zonal_model_has_the_mean_of_its_data_and_bright_poles():
    grid = zonal_reflectivity()
    assert grid.mean.shape == grid.std.shape == (36, 72)
    assert area_mean(grid.mean) == pytest.approx(0.315, abs=0.0005)
    assert grid.mean[[0, -1], 0] == pytest.approx([0.918, 0.855])  # Antarctica, then the Arctic
    assert zonal_reflectivity(1).mean.shape == (36, 1)


@pytest.mark.parametrize(
    ("latitude", "january", "july"), [(85, 0.72, 0.54), (45, 0.48, 0.35), (5, 0.21, 0.19), (-45, 0.35, 0.48)]
)
def test_knocke_model_in_january_and_july(latitude, january, july):
    row = int((latitude + 90) / 10)
    for epoch, expected in (("1996-01-15", january), ("1996-07-15", july)):
        epoch_ns = int(np.datetime64(epoch, "ns").astype(np.int64))
        assert knocke_reflectivity(epoch_ns, rows=18).mean[row, 0] == pytest.approx(expected, abs=0.011)


def test_file_rows_run_north_and_columns_east(tmp_path):
    file = tmp_path / "grid.csv"
    file.write_text("0.1,0.2,0.3,0.4\n0.5,0.6,0.7,0.8\n\n")
    grid = read_reflectivity(file)
    assert grid.mean.shape == (2, 4) and np.all(grid.std == 0.0)

    def value(latitude, longitude):
        lat, lon = math.radians(latitude), math.radians(longitude)
        cell = cell_at(math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat), 2, 4)
        return grid.mean.flat[cell]

    assert value(-45, -135) == 0.1 and value(-45, 135) == 0.4
    assert value(45, -45) == 0.6 and value(1, 1) == 0.7


def test_standard_deviations_from_a_second_file(tmp_path):
    (tmp_path / "mean.csv").write_text("0.5,0.6\n")
    (tmp_path / "std.csv").write_text("0.1,0.2\n")
    (tmp_path / "other.csv").write_text("0.1\n")
    assert read_reflectivity(tmp_path / "mean.csv", tmp_path / "std.csv").std.tolist() == [[0.1, 0.2]]
    with pytest.raises(ValueError, match=r"other\.csv: \(1, 1\) rows and columns, but .*mean\.csv has \(1, 2\)"):
        read_reflectivity(tmp_path / "mean.csv", tmp_path / "other.csv")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no values"),
        ("0.1,0.2\n0.3\n", "row 2: 1 columns, expected 2"),
        ("0.1,0.2\n0.3,snow\n", "row 2, column 2: 'snow' is not a number"),
        ("0.1,0.2\n\n31.5,0.2\n", "row 3, column 1: 31.5 is not a fraction"),
        ("nan\n", "row 1, column 1: nan is not a fraction"),
        ("0.1,\n", "row 1, column 2: '' is not a number"),
    ],
)
def test_errors_name_file_row_and_column(tmp_path, text, message):
    file = tmp_path / "grid.csv"
    file.write_text(text)
    with pytest.raises(ValueError, match=re.escape(message)) as caught:
        read_reflectivity(file)
    assert str(file) in str(caught.value)


@given(st.floats(-90, 90), st.floats(-180, 180), st.integers(1, 90), st.integers(1, 180))
@settings(deadline=None)
def test_lookup_is_the_cell_of_latitude_and_longitude(latitude, longitude, rows, columns):
    lat, lon = math.radians(latitude), math.radians(longitude)
    cell = cell_at(math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat), rows, columns)
    assert 0 <= cell < rows * columns
    row, column = (latitude + 90) / 180 * rows, (longitude + 180) / 360 * columns
    if abs(row - round(row)) > 1e-3:  # 1e-5 rad, in rows
        assert cell // columns == int(row)
    if abs(column - round(column)) > 2e-3 and abs(latitude) < 89.9:
        assert cell % columns == int(column)


def test_draws_have_the_statistics_of_the_grid_and_stay_within_limits():
    grid = zonal_reflectivity()
    drawn = np.empty((200, *grid.mean.shape))
    for case in range(200):
        draw_reflectivity(grid, random_key(3, case), False, drawn[case])
    assert drawn.min() == 0.05 and drawn.max() == 1.0
    ice = slice(0, 3)  # narrow enough that the limits hardly cut
    score = (drawn[:, ice] - grid.mean[ice]) / grid.std[ice]
    assert abs(score.mean()) < 4.0 / math.sqrt(score.size)
    assert score.std() == pytest.approx(1.0, abs=0.02)
    neighbours = np.corrcoef(score[:, 0, 0], score[:, 0, 1])[0, 1]
    assert abs(neighbours) < 0.3


def test_common_draw_moves_the_whole_earth_together_and_repeats():
    grid = zonal_reflectivity()
    first, again, other = (np.empty_like(grid.mean) for _ in range(3))
    draw_reflectivity(grid, random_key(3, 1), True, first)
    draw_reflectivity(grid, random_key(3, 1), True, again)
    draw_reflectivity(grid, random_key(3, 2), True, other)
    np.testing.assert_array_equal(first, again)
    inside = (first > 0.05) & (first < 1.0)
    scores = ((first - grid.mean) / grid.std)[inside]
    np.testing.assert_allclose(scores, scores[0], atol=1e-12)
    assert np.any(first != other)


def test_without_deviations_a_draw_is_the_mean():
    grid = constant_reflectivity(0.3)
    drawn = np.empty((1, 1))
    draw_reflectivity(grid, random_key(1, 1), False, drawn)
    assert drawn[0, 0] == 0.3


def test_correlated_draws_have_the_correlation_and_the_statistics_of_cells():
    """Over 400 cases: unit variance everywhere, and exp(-a^2 / (2 L^2)) between cells an angle a apart."""
    length = np.radians(20.0)
    grid = Reflectivity(np.full((36, 72), 0.5), np.full((36, 72), 0.05))
    draws = np.array([draw_correlated(grid, random_key(1, case), length) for case in range(400)])
    field = (draws - 0.5) / 0.05
    assert np.abs(field.mean()) < 0.05
    assert field.std(axis=0) == pytest.approx(1.0, abs=0.2)
    # along the row nearest to the equator, 5 deg from cell to cell, and down a column
    for steps in (1, 4, 8):
        expected = np.exp(-0.5 * (np.radians(5.0 * steps) / length) ** 2)
        along = np.mean(field[:, 18] * np.roll(field[:, 18], steps, axis=1))
        down = np.mean(field[:, 10] * field[:, 10 + steps])
        assert along == pytest.approx(expected, abs=0.08) and down == pytest.approx(expected, abs=0.08)


def test_a_case_has_the_same_correlated_earth_again():
    grid = zonal_reflectivity()
    first, again, other = (draw_correlated(grid, random_key(1, case), 0.3) for case in (4, 4, 5))
    assert np.array_equal(first, again) and not np.array_equal(first, other)
