# SPDX-License-Identifier: Apache-2.0
"""Scale and alignment of each cell as errors of the attitude filter (Springmann & Cutler 2014; O'Keefe & Schaub 2015).

A cell reads C (n.s) with its scale C and its normal n = unit(n0 + a e1 + b e2), e1 and e2 across the nominal normal
n0. What is calibrated of each cell is the last of a filter's errors: C, or C, a and b. Estimated, they are
corrected; considered, they keep their value and variance and only make the filter trust the cells less.
"""

from typing import NamedTuple

import numpy as np

from css_common.conversions import cosine_of_degrees, square, square_of_degrees
from css_common.declared import made
from css_common.kernel import kernel
from css_common.schema import choice, flag, real
from css_common.vectors import Vec3, add, axes_across, dot, scale, unit

SCALE, TILT_1, TILT_2 = 0, 1, 2
"""Columns of the calibration of the cells, (N, 3)."""

_SMALLEST_SCALE, _LARGEST_SCALE = 0.1, 3.0
_LARGEST_TILT = 0.5


_MODE = choice(
    "calibration.mode",
    "off",
    ("off", "estimate", "consider"),
    "errors of each cell: none, estimated with the attitude, or considered as a source of error",
)
_ALIGNMENT = flag("calibration.alignment", False, "besides the scale of each cell, also its two alignment angles")


def _per_cell(mode: str, alignment: bool) -> int:
    return 0 if mode == "off" else 3 if alignment else 1


def _scale_variance(mode: str, sigma: float) -> float:
    return 0.0 if mode == "off" else sigma**2


def _alignment_variance(mode: str, alignment: bool, sigma_deg: float) -> float:
    return 0.0 if mode == "off" or not alignment else square_of_degrees(sigma_deg)


class CellCalibration(NamedTuple):
    """What is calibrated, and how it errs."""

    per_cell: int = made(_per_cell, _MODE, _ALIGNMENT)  # errors of each cell: 0, 1 or 3
    estimated: bool = made(lambda mode: mode == "estimate", _MODE)
    scale_variance: float = made(
        _scale_variance,
        _MODE,
        real("calibration.scale_sigma", 0.1, "-", "scale error at the start, 1 sigma", low=0.0, high=1.0),
    )
    alignment_variance: float = made(  # [rad^2]
        _alignment_variance,
        _MODE,
        _ALIGNMENT,
        real(
            "calibration.alignment_sigma_deg", 2.0, "deg", "alignment error at the start, 1 sigma", low=0.0, high=30.0
        ),
    )
    scale_noise: float = made(  # [1/s]
        square, real("calibration.scale_walk", 1e-6, "1/sqrt(s)", "drift of each scale, 1 sigma", low=0.0, high=1.0)
    )
    alignment_noise: float = made(  # [rad^2/s]
        square_of_degrees,
        real("calibration.alignment_walk_deg", 0.0, "deg/sqrt(s)", "drift of each angle, 1 sigma", low=0.0, high=1.0),
    )
    least_cosine: float = made(  # of the incidence up to which a cell calibrates
        cosine_of_degrees,
        real("calibration.largest_incidence_deg", 70.0, "deg", "no calibration beyond it", low=0.0, high=90.0),
    )


def nominal(cells: int) -> np.ndarray:
    """Calibration (N, 3) of cells as the mission has them."""
    calibration = np.zeros((cells, 3))
    calibration[:, SCALE] = 1.0
    return calibration


@kernel
def initial_variance(p: CellCalibration, k: int) -> float:
    """Variance of the k-th error of a cell."""
    return p.scale_variance if k == SCALE else p.alignment_variance


@kernel
def add_drift(p: CellCalibration, first: int, covariance, dt: float) -> None:
    """Walk of the calibration errors over `dt` [s]; considered ones have none, their variance is what it is.

    Args:
        first: index of the first of them.
    """
    if not p.estimated:
        return
    for i in range(first, covariance.shape[0]):
        k = (i - first) % p.per_cell
        covariance[i, i] += dt * (p.scale_noise if k == SCALE else p.alignment_noise)


@kernel
def tilted_normal(normal_b: Vec3, a: float, b: float) -> tuple[Vec3, Vec3, Vec3]:
    """A normal that is tilted, and the two axes across the nominal one along which it is, by `a` and `b` [rad]."""
    e1, e2 = axes_across(normal_b)
    if a == 0.0 and b == 0.0:
        return normal_b, e1, e2
    return unit(add(normal_b, add(scale(a, e1), scale(b, e2)))), e1, e2


@kernel
def calibrated_normal(normal_b: Vec3, calibration, i: int) -> tuple[Vec3, Vec3, Vec3]:
    """Normal of cell `i`, and the two axes across the nominal one along which it tilts."""
    return tilted_normal(normal_b, calibration[i, TILT_1], calibration[i, TILT_2])


@kernel
def calibration_partials(light: float, brightness: float, e1: Vec3, e2: Vec3, sun_b: Vec3) -> Vec3:
    """Derivatives of a cell's output to its scale and its two tilts.

    Args:
        light: predicted output of a scale of one.
        brightness: scale times the Sun's intensity.
    """
    return (light, brightness * dot(e1, sun_b), brightness * dot(e2, sun_b))


@kernel
def correct(p: CellCalibration, first: int, calibration, correction) -> None:
    """Applies the gathered corrections (n,) of all errors; scales and tilts stay within what a cell can have.

    Args:
        first: index of the first calibration error.
    """
    if not p.estimated:
        return
    for i in range(calibration.shape[0]):
        for k in range(p.per_cell):
            value = calibration[i, k] + correction[first + p.per_cell * i + k]
            if k == SCALE:
                value = min(max(value, _SMALLEST_SCALE), _LARGEST_SCALE)
            else:
                value = min(max(value, -_LARGEST_TILT), _LARGEST_TILT)
            calibration[i, k] = value
