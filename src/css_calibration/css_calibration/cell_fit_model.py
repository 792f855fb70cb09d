# SPDX-License-Identifier: Apache-2.0
"""The model of the cells that a calibration fits: outputs at many instants, and how they change with what is sought.

    V_ik = dark_i + gain_i (1 + kappa_i (T_k - T_0)) R(light_ik),
    light_ik = intensity_k max(0, n_i.s_k) seen_ik + earth albedo_ik,    n_i = unit(n0_i + a_i e1_i + b_i e2_i)

with the response R of `sun_filter.response` and the tilts a and b of `cell_calibration`, so that what is found means
the same there.
"""

import math

import numpy as np

from css_common.kernel import kernel
from css_common.vectors import dot, row
from css_estimation.sun.cell_calibration import tilted_normal
from css_estimation.sun_filter.options import Response
from css_estimation.sun_filter.response import respond

GAIN, DARK, TILT_1, TILT_2, KAPPA = range(5)
"""Columns of the parameters of the cells, (N, 5): [-], [-], [rad], [rad], [1/K]."""
PER_CELL = 5
EARTH = PER_CELL
"""Column of the derivatives by the brightness of the Earth, behind those of the cell."""


def nominal_parameters(cells: int) -> np.ndarray:
    """(N, 5) of cells as the mission has them."""
    parameters = np.zeros((cells, PER_CELL))
    parameters[:, GAIN] = 1.0
    return parameters


def normals_of(nominal_b: np.ndarray, parameters: np.ndarray) -> np.ndarray:
    """(N, 3) normals of cells with parameters (N, 5)."""
    rows = zip(nominal_b.tolist(), parameters.tolist(), strict=True)
    return np.array([tilted_normal.py_func(tuple(n), p[TILT_1], p[TILT_2])[0] for n, p in rows])


def response_of(curve: int, table: np.ndarray | None = None) -> Response:
    """The response of a curve of `sun_filter.options`, its scale being part of the gains."""
    return Response(curve, np.zeros(0) if table is None else table, 1.0)


@kernel
def predict_cells(
    response: Response, normals_b, parameters, earth: float, sun_b, intensity, seen, albedo, warmth, out, slopes, turns
) -> None:
    """Outputs and their derivatives.

    Args:
        response: of the cells, of scale 1.
        normals_b: (N, 3) nominal ones.
        parameters: (N, 5).
        earth: brightness of the Earth relative to the mean one.
        sun_b: (M, 3); intensity: (M,); seen: (M, N) whether the Sun is in view; albedo: (M, N); warmth: (M,) T - T_0.
        out: (M, N) written.
        slopes: (M, N, 6) written: by the parameters of the cell, and by `earth`.
        turns: (M, N, 3) written: by the Sun vector in b.
    """
    for i in range(normals_b.shape[0]):
        gain, dark, kappa = parameters[i, GAIN], parameters[i, DARK], parameters[i, KAPPA]
        a, b = parameters[i, TILT_1], parameters[i, TILT_2]
        n, e1, e2 = tilted_normal(row(normals_b, i), a, b)
        longer = math.sqrt(1.0 + a * a + b * b)
        for k in range(sun_b.shape[0]):
            s = row(sun_b, k)
            cosine = dot(n, s)
            lit = seen[k, i] and cosine > 0.0
            light = earth * albedo[k, i] + (intensity[k] * cosine if lit else 0.0)
            answer, slope = respond(response, light)
            warm = 1.0 + kappa * warmth[k]
            out[k, i] = dark + gain * warm * answer
            by_light = gain * warm * slope
            by_cosine = by_light * intensity[k] if lit else 0.0
            slopes[k, i, GAIN] = warm * answer
            slopes[k, i, DARK] = 1.0
            # the unit vector turns across itself alone
            slopes[k, i, TILT_1] = by_cosine * (dot(e1, s) - dot(e1, n) * cosine) / longer
            slopes[k, i, TILT_2] = by_cosine * (dot(e2, s) - dot(e2, n) * cosine) / longer
            slopes[k, i, KAPPA] = gain * warmth[k] * answer
            slopes[k, i, EARTH] = by_light * albedo[k, i]
            for j in range(3):
                turns[k, i, j] = by_cosine * n[j]
