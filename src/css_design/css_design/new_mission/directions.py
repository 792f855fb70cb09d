# SPDX-License-Identifier: Apache-2.0
"""Words for directions of the body: faces such as `+x`, and vectors such as `0.7/0/0.7`."""

import math
from collections.abc import Sequence

from css_design.errors import DesignError

Vector = tuple[float, float, float]

FACES: dict[str, Vector] = {
    "+x": (1.0, 0.0, 0.0),
    "-x": (-1.0, 0.0, 0.0),
    "+y": (0.0, 1.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "+z": (0.0, 0.0, 1.0),
    "-z": (0.0, 0.0, -1.0),
}
"""Outward normals of the faces of a box."""

_EXPECTED = "a face (+x, -x, +y, -y, +z, -z) or a vector such as 0.7/0/0.7"


def direction(text: str) -> Vector:
    """Unit vector in b of a word.

    Raises:
        DesignError: it is none.
    """
    word = text.strip()
    if word in FACES:
        return FACES[word]
    parts = word.split("/")
    try:
        vector = [float(part) for part in parts]
    except ValueError:
        vector = []
    length = math.hypot(*vector) if len(vector) == 3 else 0.0
    if not 1e-9 < length < math.inf:
        raise DesignError(f"{text!r} given, expected {_EXPECTED}")
    x, y, z = (part / length for part in vector)
    return x, y, z


def axis_of(face: Sequence[float]) -> int:
    """Number of the body axis along a face's normal."""
    return max(range(3), key=lambda i: abs(face[i]))
