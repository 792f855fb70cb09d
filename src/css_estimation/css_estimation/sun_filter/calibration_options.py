# SPDX-License-Identifier: Apache-2.0
"""Whether the Sun filter calibrates its cells in flight, and what it knows of them before."""

import math
from typing import NamedTuple

from css_common.conversions import square, square_of_degrees
from css_common.declared import made
from css_common.schema import Values, choice, real

MODE = choice(
    "calibration.mode",
    "auto",
    ("auto", "off", "estimate", "consider"),
    "gain and tilts of each cell: one error that fades, estimated, or considered as they are known before the flight; "
    "auto: considered if gain_sigma is above 0.005 or tilt_sigma_deg above 0.25, else one error",
)
GAIN_SIGMA = real("gain_sigma", 0.002, "-", "lasting error of each cell's gain, 1 sigma", low=0.0, high=1.0)
TILT_SIGMA = real(
    "tilt_sigma_deg",
    0.1,
    "deg",
    "lasting error of each cell's normal about an axis, 1 sigma",
    low=0.0,
    high=45.0,
)
RESIDUAL = real(
    "calibration.residual",
    0.002,
    "-",
    "lasting error of each cell's output that gain and tilts do not explain, 1 sigma",
    low=0.0,
    high=1.0,
)


# What the one error that fades, relative to a cell's output, stands for well enough. A tilt does as much to a dark cell
# as to a bright one, and that error knows nothing of it.
_SMALL_GAIN, _SMALL_TILT_DEG = 0.005, 0.25


def _mode(mode: str, gain_sigma: float, tilt_sigma_deg: float) -> str:
    """What `auto` stands for, or what was given."""
    if mode != "auto":
        return mode
    return "consider" if gain_sigma > _SMALL_GAIN or tilt_sigma_deg > _SMALL_TILT_DEG else "off"


def lasting_error(values: Values) -> float:
    """Variance of a cell's output relative to its own: by what the states of calibration leave of its error.

    Without them by its gain and by a tilt where that matters most, at 60 deg.
    """
    if _mode(values[MODE], values[GAIN_SIGMA], values[TILT_SIGMA]) != "off":
        return values[RESIDUAL] ** 2
    return values[GAIN_SIGMA] ** 2 + (math.tan(math.radians(60.0)) * math.radians(values[TILT_SIGMA])) ** 2


def _per_cell(mode: str, gain_sigma: float, tilt_sigma_deg: float) -> int:
    return 0 if _mode(mode, gain_sigma, tilt_sigma_deg) == "off" else 3


def _margin(mode: str, gain_sigma: float, tilt_sigma_deg: float) -> float:
    return 0.0 if _mode(mode, gain_sigma, tilt_sigma_deg) == "off" else 2.0 * math.radians(tilt_sigma_deg)


class Calibration(NamedTuple):
    """What is known of gain and tilts of each cell before the flight."""

    per_cell: int = made(_per_cell, MODE, GAIN_SIGMA, TILT_SIGMA)  # states of each cell
    estimated: bool = made(lambda mode: mode == "estimate", MODE)
    gain: float = made(square, GAIN_SIGMA)
    tilt: float = made(square_of_degrees, TILT_SIGMA)  # [rad2]
    margin: float = made(_margin, MODE, GAIN_SIGMA, TILT_SIGMA)  # [rad] by which edges of views are uncertain
