# SPDX-License-Identifier: Apache-2.0
"""Outputs of the cells, one by one, as measurements of attitude (DiGregorio & Crassidis, "VMM").

The predicted Sun gives each cell's output, C (I max(0, n.s) + albedo), which is compared with the measured one: cells
count also where those that are lit do not span space. Which cells are used decides whether the filter finds the
attitude from afar. With those alone that are both lit and expected to be, it can settle on a wrong attitude whose
contradicting cells it never looks at. Safe are

* `lit_or_expected`: cells that are lit or should be, the prediction cut at zero, the slope that of the uncut cosine,
  so that a cell that should be dark still says which way to turn;
* `lit`: cells that are lit, with the uncut cosine as prediction.
"""

from typing import NamedTuple

from css_common.conversions import square
from css_common.declared import computed, given, made, part
from css_common.kernel import kernel
from css_common.schema import choice, real
from css_common.vectors import Vec3, cross, dot, scale
from css_estimation.sun.cell_calibration import (
    SCALE,
    CellCalibration,
    calibrated_normal,
    calibration_partials,
)
from css_estimation.sun.cell_layout import CellLayout, cell_layout, sees
from css_estimation.sun.error_covariance import CALIBRATION, Partials


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
        real("albedo.share_sigma", 0.3, "-", "error of a predicted albedo, relative, 1 sigma", low=0.0, high=10.0)
    )
    calibration: CellCalibration = part(CellCalibration)


class CellMeasurement(NamedTuple):
    """One cell's output against its prediction."""

    used: bool
    partials: Partials
    residual: float
    variance: float
    calibrates: bool  # incidence and light are such that its scale and alignment may be corrected


@kernel
def cell_measurement(
    p: CellModel, calibration, i: int, output: float, is_lit: bool, sun_b: Vec3, intensity: float, albedo: float
) -> CellMeasurement:
    """Output of cell `i` against its prediction.

    Args:
        calibration: (N, 3) scale and tilts of the cells.
        is_lit: the output says that the Sun is seen.
        sun_b: predicted unit vector to the Sun.
        intensity: of the Sun, 1 at 1 AU.
        albedo: predicted light of the Earth on the cell, 0 without compensation.
    """
    cell = p.layout.cells[i]
    normal_b, e1, e2 = calibrated_normal((cell.nx, cell.ny, cell.nz), calibration, i)
    cosine = dot(normal_b, sun_b)
    brightness = calibration[i, SCALE] * intensity
    seen = max(0.0, cosine) if p.expected_too else cosine
    predicted = brightness * seen + calibration[i, SCALE] * albedo
    error = p.albedo_share * albedo
    c = p.calibration
    first = CALIBRATION + c.per_cell * i if c.per_cell > 0 else 0
    partials = Partials(
        scale(brightness, cross(normal_b, sun_b)),
        first,
        c.per_cell,
        calibration_partials(intensity * seen + albedo, brightness, e1, e2, sun_b),
    )
    return CellMeasurement(
        is_lit or (p.expected_too and cosine > 0.0 and sees(p.layout, i, sun_b)),
        partials,
        output - predicted,
        p.variance + error * error,
        is_lit and cosine > c.least_cosine,
    )
