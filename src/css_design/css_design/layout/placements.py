# SPDX-License-Identifier: Apache-2.0
"""Where a cell can be put: on a face of the body, tilted from its normal."""

import math
from collections.abc import Sequence

import numpy as np

from css_design.errors import DesignError
from css_design.layout.readings import Cells

FACES = {
    "+x": (1.0, 0.0, 0.0),
    "-x": (-1.0, 0.0, 0.0),
    "+y": (0.0, 1.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "+z": (0.0, 0.0, 1.0),
    "-z": (0.0, 0.0, -1.0),
}
TILTS_DEG = (0.0, 30.0, 45.0)
_AZIMUTHS = 8
_SAME = math.cos(math.radians(0.5))
_FROM_PLANE = math.sin(math.radians(1.0))


def faces_of(names: Sequence[str]) -> list[np.ndarray]:
    """Outward normals of faces by name.

    Raises:
        DesignError: there is no such face.
    """
    for name in names:
        if name not in FACES:
            raise DesignError(f"--faces: {name} given, expected some of {' '.join(FACES)}")
    return [np.array(FACES[name]) for name in dict.fromkeys(names)]


def candidates(faces: Sequence[np.ndarray], tilts_deg: Sequence[float], views_deg: Sequence[float]) -> Cells:
    """Places that a search begins with: each tilt of each face, in eight directions, with each cone of view."""
    found: list[np.ndarray] = []
    for face in faces:
        first = np.eye(3)[int(np.argmin(np.abs(face)))]
        second = np.cross(face, first)
        for tilt in np.radians(tilts_deg):
            for azimuth in np.arange(_AZIMUTHS) * (2.0 * math.pi / _AZIMUTHS) if tilt > 0.0 else (0.0,):
                across = math.cos(azimuth) * first + math.sin(azimuth) * second
                normal = math.cos(tilt) * face + math.sin(tilt) * across
                if not any(normal @ other > _SAME for other in found):
                    found.append(normal)
    return Cells(np.repeat(found, len(views_deg), axis=0), np.tile(views_deg, len(found)))


def allowed(normals_b: np.ndarray, faces: Sequence[np.ndarray], tilt_deg: float, clip_normal_b: np.ndarray) -> bool:
    """Whether cells (N, 3) are on some face within a tilt, and clear of the plane that hides half of the sky.

    A cell in that plane would not count as clipped by it, and see more than the structure lets pass.
    """
    if np.any(clip_normal_b) and np.any(np.abs(normals_b @ clip_normal_b) < _FROM_PLANE):
        return False
    cosines = normals_b @ np.array(faces).T
    return bool(np.all(cosines.max(axis=1) >= math.cos(math.radians(tilt_deg)) - 1e-9))
