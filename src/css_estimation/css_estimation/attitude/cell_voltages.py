# SPDX-License-Identifier: Apache-2.0
"""Outputs of the cells, one by one, as measurements of attitude (DiGregorio & Crassidis, "VMM").

The predicted Sun gives each cell's output, C (I max(0, n.s) + albedo), which is compared with the measured one: cells
count also where those that are lit do not span space. Which cells are used decides whether the filter finds the
attitude from afar. With those alone that are both lit and expected to be, it can settle on a wrong attitude whose
contradicting cells it never looks at. Safe are

* `lit_or_expected`: cells that are lit or should be, the prediction cut at zero, the slope that of the uncut cosine,
  so that a cell that should be dark still says which way to turn;
* `lit`: cells that are lit, with the uncut cosine as prediction.

A cell that looks away from the Sun by more than the attitude can err has no slope of the Sun: it measures the light of
the Earth alone, which would otherwise be taken for a Sun that grazes it.
"""

from typing import NamedTuple

from css_common.conversions import square
from css_common.declared import computed, given, made, part
from css_common.kernel import kernel
from css_common.schema import choice, real
from css_common.vectors import Vec3, add, cross, dot, row, scale
from css_estimation.attitude.earth_on_cells import EarthOnCells
from css_estimation.attitude.slow_errors import ERROR_MODEL, first_of_cells
from css_estimation.sun.cell_calibration import (
    SCALE,
    CellCalibration,
    calibrated_normal,
    calibration_partials,
)
from css_estimation.sun.cell_layout import CellLayout, cell_layout, sees
from css_estimation.sun.error_covariance import Block, Partials, no_block


class CellModel(NamedTuple):
    """How outputs are predicted."""

    layout: CellLayout = computed(cell_layout)
    expected_too: bool = made(  # use cells that should be lit but are not
        lambda word: word == "lit_or_expected",
        choice(
            "cells_used",
            "lit_or_expected",
            ("lit_or_expected", "lit"),
            "voltage model: cells that are lit or should be, or those that are lit",
        ),
    )
    variance: float = made(  # of an output, all causes
        square,
        real(
            "cell_sigma", 0.02, "-", "cell error, all causes, 1 sigma", low=0.0, open_low=True, high=10.0, tunable=True
        ),
    )
    albedo_share: float = given(
        real(
            "albedo.share_sigma",
            0.3,
            "-",
            "error of the predicted albedo of each cell for itself, relative, 1 sigma",
            low=0.0,
            high=10.0,
        )
    )
    calibration: CellCalibration = part(CellCalibration)
    calibration_at: int = made(first_of_cells, ERROR_MODEL)  # index of the first calibration error


class CellMeasurement(NamedTuple):
    """One cell's output against its prediction."""

    used: bool
    partials: Partials
    residual: float
    variance: float
    calibrates: bool  # incidence and light are such that its scale and alignment may be corrected


@kernel
def cell_measurement(
    p: CellModel,
    calibration,
    i: int,
    output: float,
    is_lit: bool,
    sun_b: Vec3,
    intensity: float,
    earth: EarthOnCells,
    darkest: float,
) -> CellMeasurement:
    """Output of cell `i` against its prediction.

    Args:
        calibration: (N, 3) scale and tilts of the cells.
        is_lit: the output says that the Sun is seen.
        sun_b: predicted unit vector to the Sun.
        intensity: of the Sun, 1 at 1 AU.
        earth: light of the Earth on the cells.
        darkest: cosine of the Sun below which a cell sees the Earth alone, -1 or less: none does.
    """
    cell = p.layout.cells[i]
    normal_b, e1, e2 = calibrated_normal((cell.nx, cell.ny, cell.nz), calibration, i)
    cosine = dot(normal_b, sun_b)
    gain = calibration[i, SCALE]
    from_earth = earth.brightness * earth.light[i]
    faces_away = cosine < darkest
    seen = 0.0 if faces_away else max(0.0, cosine) if p.expected_too else cosine
    brightness = 0.0 if faces_away else gain * intensity
    error = p.albedo_share * from_earth
    c = p.calibration
    own = no_block()
    if c.per_cell > 0:
        slopes = calibration_partials(intensity * seen + from_earth, brightness, e1, e2, sun_b)
        own = Block(p.calibration_at + c.per_cell * i, c.per_cell, slopes)
    attitude = add(scale(brightness, cross(normal_b, sun_b)), scale(gain * earth.brightness, row(earth.slopes, i)))
    partials = Partials(attitude, own, Block(earth.at, earth.errors, (gain * earth.light[i], 0.0, 0.0)))
    expected = p.expected_too and cosine > 0.0 and sees(p.layout, i, sun_b)
    return CellMeasurement(
        earth.light[i] > 0.0 if faces_away else is_lit or expected,
        partials,
        output - gain * (intensity * seen + from_earth),
        p.variance + error * error,
        is_lit and cosine > c.least_cosine,
    )
