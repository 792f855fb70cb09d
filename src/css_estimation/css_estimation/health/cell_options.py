# SPDX-License-Identifier: Apache-2.0
"""Parameters of the health of cells."""

import math
from typing import NamedTuple

import numpy as np

from css_common.conversions import square
from css_common.declared import builder, computed, given, made, table_of
from css_common.schema import Values, flag, integers, real
from css_estimation.sun.cell_layout import CellLayout, cell_layout

ENABLED = flag("health.enabled", True, "leave out cells that fail, by what the others read")

_NAMED = "health.cells."


_SCREENED = integers(
    _NAMED + "screened",
    (),
    "-",
    "cells, from 0, that structure hides in part: what their normals make of the Sun they may read, or less",
    low=0,
    high=31,
)


def _screened(values: Values) -> int:
    mask = 0
    for i in np.asarray(values[_SCREENED]).tolist():
        mask |= 1 << i
    return mask


class CellHealthParameters(NamedTuple):
    """What a healthy cell may do."""

    layout: CellLayout = computed(cell_layout)
    screened: int = computed(_screened, _SCREENED)  # mask
    largest: float = given(
        real(_NAMED + "largest", 1.3, "-", "no healthy cell reads more, calibration and Earth included", low=0.1)
    )
    smallest: float = given(real(_NAMED + "smallest", -0.1, "-", "no healthy cell reads less", high=0.0))
    noise: float = given(
        real(_NAMED + "noise", 0.02, "-", "white noise of a cell, at most, 1 sigma", low=1e-6, high=1.0)
    )
    floor: float = made(
        square,
        real(_NAMED + "floor", 0.03, "-", "lasting error of a cell whatever it reads, 1 sigma", low=1e-6, high=1.0),
    )
    share: float = made(
        square,
        real(
            _NAMED + "share",
            0.08,
            "-",
            "lasting error of a cell as a share of its output: gain, response, 1 sigma",
            low=0.0,
            high=1.0,
        ),
    )
    heading: float = made(  # [rad^2]
        lambda degrees: math.radians(degrees) ** 2,
        real(
            _NAMED + "heading_deg",
            3.0,
            "deg",
            "lasting error of the heading of the cells together, tilts and Earth, per axis, 1 sigma",
            low=0.0,
            high=45.0,
        ),
    )
    earth: float = given(
        real(_NAMED + "earth_light", 0.5, "-", "no Earth throws more light on a cell", low=0.0, high=2.0)
    )
    minimum: float = given(
        real(_NAMED + "minimum_output", 0.3, "-", "no Sun unless a cell is above it", low=0.01, high=1.0)
    )
    longest_eclipse: float = given(
        real(
            _NAMED + "longest_eclipse",
            4500.0,
            "s",
            "without a model of the orbit: darkness longer than it is none, but cells that fail together",
            low=60.0,
            high=1e6,
        )
    )
    gate: float = made(
        square,
        real(_NAMED + "gate_sigma", 3.5, "-", "sigmas beyond which a cell contradicts the others", low=1.0, high=100.0),
    )
    threshold: float = given(
        real(
            _NAMED + "threshold",
            20.0,
            "-",
            "contradiction at which a cell is left out: sum over seconds of squared sigmas beyond 2, at most 25 each",
            low=1.0,
            high=1e4,
        )
    )
    return_time: float = given(
        real(
            _NAMED + "return_time",
            60.0,
            "s",
            "a cell that agreed for so long is used again; twice as long after each time that it failed",
            low=1.0,
            high=1e6,
        )
    )


PARAMETERS = table_of(CellHealthParameters)
parameters = builder(CellHealthParameters)
