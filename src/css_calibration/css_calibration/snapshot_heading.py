# SPDX-License-Identifier: Apache-2.0
"""Direction to the Sun that the outputs of one instant give by themselves: what a calibration is worth, and no filter.

Gauss-Newton on the two angles across the direction, from the reference on, so that of several directions that fit the
nearest counts. An instant counts when its lit cells tell both angles.
"""

import math

import numpy as np

from css_calibration.cell_data import CellData
from css_calibration.cell_fit_model import DARK, GAIN, KAPPA, normals_of
from css_common.kernel import kernel, typed_call
from css_common.vectors import add, axes_across, dot, row, scale, unit
from css_estimation.sun_filter.options import Response
from css_estimation.sun_filter.response import respond

_STEPS = 8
_LEAST = 0.05  # smallest eigenvalue of the normal matrix by which both angles are told
_LIT = 0.05
_LARGEST_STEP = 0.3  # [rad]


def heading_errors(data: CellData, parameters: np.ndarray, earth: float, least: float = _LEAST) -> np.ndarray:
    """(M,) [rad] angles from the reference to what the cells say with parameters (N, 5); NaN where they do not."""
    errors = np.empty(len(data.sun_b))
    _errors(
        data.response, normals_of(data.normals_b, parameters), np.ascontiguousarray(parameters), float(earth),
        data.sun_b, data.intensity, data.seen & data.usable, data.albedo, data.warmth, data.voltages, least, errors,
    )  # fmt: skip
    return errors


@kernel
def _errors_of(
    response: Response, normals_b, parameters, earth: float, sun_b, intensity, counts, albedo, warmth, voltages,
    least: float, out,
) -> None:  # fmt: skip
    for k in range(out.shape[0]):
        reference = row(sun_b, k)
        s, told = reference, True
        for _ in range(_STEPS):
            e1, e2 = axes_across(s)
            h11, h12, h22, g1, g2 = 0.0, 0.0, 0.0, 0.0, 0.0
            for i in range(normals_b.shape[0]):
                if not counts[k, i]:
                    continue
                n = row(normals_b, i)
                cosine = dot(n, s)
                if cosine < _LIT:
                    continue
                factor = parameters[i, GAIN] * (1.0 + parameters[i, KAPPA] * warmth[k])
                answer, slope = respond(response, intensity[k] * cosine + earth * albedo[k, i])
                off = voltages[k, i] - parameters[i, DARK] - factor * answer
                by = factor * slope * intensity[k]
                a, b = by * dot(n, e1), by * dot(n, e2)
                h11, h12, h22 = h11 + a * a, h12 + a * b, h22 + b * b
                g1, g2 = g1 + a * off, g2 + b * off
            mean, half = 0.5 * (h11 + h22), math.sqrt(0.25 * (h11 - h22) ** 2 + h12 * h12)
            if mean - half < least:
                told = False
                break
            determinant = h11 * h22 - h12 * h12
            x, y = (h22 * g1 - h12 * g2) / determinant, (h11 * g2 - h12 * g1) / determinant
            length = math.sqrt(x * x + y * y)
            shorter = min(1.0, _LARGEST_STEP / max(length, 1e-12))
            s = unit(add(s, add(scale(shorter * x, e1), scale(shorter * y, e2))))
            if length < 1e-9:
                break
        cosine = min(1.0, max(-1.0, dot(s, reference)))
        chord = math.sqrt(max(0.0, 2.0 - 2.0 * cosine))
        out[k] = 2.0 * math.asin(min(1.0, 0.5 * chord)) if told else math.nan


_errors = typed_call(_errors_of)
