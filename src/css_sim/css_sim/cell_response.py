# SPDX-License-Identifier: Apache-2.0
"""Output of a cell over the angle of the Sun, as measured: a table instead of the cosine, one for all or one each.

Between the angles of the table it is linear, beyond the last one zero. Light of the Earth, which comes from many sides,
is taken by the cosine.
"""

import math
from collections.abc import Iterator

import numpy as np

from css_common.kernel import kernel
from css_common.schema import Table, Values, reals
from css_sensors.cells import NORMALS

ANGLES = reals(
    "response.angles_deg",
    (),
    "deg",
    "angles of the Sun from the normal of a cell, from 0 on; empty: cosine",
    low=0.0,
    high=90.0,
)
OUTPUTS = reals(
    "response.outputs",
    (),
    "-",
    "outputs at these angles, relative to the normal Sun: once for all cells, or for one cell after the other",
    low=0.0,
    high=2.0,
)
PARAMETERS: Table = (ANGLES, OUTPUTS)

_STEPS = 90
_PER_RADIAN = _STEPS / (0.5 * math.pi)


def tables(values: Values) -> np.ndarray:
    """Outputs (N, 91) at 0, 1, ... 90 deg, (1, 91) where cells are alike, (0, 91) without a table."""
    angles, outputs = values[ANGLES], values[OUTPUTS]
    if not len(angles) or len(outputs) % len(angles):
        return np.zeros((0, _STEPS + 1))
    at = np.linspace(0.0, 90.0, _STEPS + 1)
    return np.array([np.interp(at, angles, of_cell, right=0.0) for of_cell in outputs.reshape(-1, len(angles))])


@kernel
def response_at(responses, i: int, cosine: float) -> float:
    """Output by row `i` of tables at the cosine of an angle."""
    at = math.acos(min(max(cosine, 0.0), 1.0)) * _PER_RADIAN
    k = min(int(at), _STEPS - 1)
    return responses[i, k] + (at - k) * (responses[i, k + 1] - responses[i, k])


def conflicts(values: Values) -> Iterator[str]:
    """What is wrong between the values, one message each."""
    angles, outputs, cells = values[ANGLES], values[OUTPUTS], len(values[NORMALS])
    if len(angles) == 0 and len(outputs) == 0:
        return
    if len(angles) < 2 or angles[0] != 0.0 or np.any(np.diff(angles) <= 0.0):
        yield f"{ANGLES.name}: expected at least two angles that rise from 0"
    elif len(outputs) not in (len(angles), cells * len(angles)):
        yield (
            f"{OUTPUTS.name}: {len(outputs)} given, expected {len(angles)}, one for each angle, or these for each of "
            f"{cells} cells"
        )
