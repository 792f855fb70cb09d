# SPDX-License-Identifier: Apache-2.0
"""Light of the Earth on each cell as the filter predicts it: by its attitude, and by how bright it finds the Earth."""

from typing import NamedTuple

import numpy as np

from css_common.kernel import kernel
from css_common.vectors import Mat3
from css_environment.albedo import albedo_output
from css_environment.albedo_slope import albedo_slopes
from css_estimation.sun.cell_layout import CellLayout


class EarthOnCells(NamedTuple):
    """Of N cells, for an Earth of the model's brightness."""

    counts: bool  # there is such light, and it is predicted
    light: np.ndarray  # (N,) [-]
    slopes: np.ndarray  # (N, 3) [1/rad] its derivative to the attitude error
    brightness: float  # of the Earth, relative to the model's
    at: int  # index of the error of the brightness
    errors: int  # 1: it is an error of the filter, else 0


@kernel
def predict_earth_on_cells(layout: CellLayout, dcm_bn: Mat3, light, work, output, slopes) -> None:
    """Writes `output` (N,) and `slopes` (N, 3) of `EarthOnCells`.

    Args:
        light: (192,) patches of light of the Earth.
        work: (224,) room.
    """
    albedo_output(light, layout.cells, layout.screen, layout.cos_half_view, dcm_bn, work, output)
    albedo_slopes(light, layout.cells, layout.screen, layout.cos_half_view, dcm_bn, slopes)


@kernel
def no_earth_on_cells(output, slopes) -> None:
    """Writes `output` (N,) and `slopes` (N, 3) of an Earth without light."""
    for i in range(output.shape[0]):
        output[i] = 0.0
        for k in range(3):
            slopes[i, k] = 0.0
