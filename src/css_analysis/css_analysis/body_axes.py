# SPDX-License-Identifier: Apache-2.0
"""Where a direction of the body is in maps of the sphere about the array normal."""

import numpy as np
from numpy.typing import ArrayLike


def axes_about(array_normal_b: ArrayLike) -> np.ndarray:
    """(3, 3) axes of the maps in b, as rows: the third is the array normal (3,), a unit vector.

    Azimuth zero is towards the body's x axis (y, when x is the normal).
    """
    third = np.asarray(array_normal_b, dtype=np.float64)
    start = np.eye(3)[0] if abs(third[0]) < 0.9 else np.eye(3)[1]
    second = np.cross(third, start)
    second /= np.linalg.norm(second)
    return np.array([np.cross(second, third), second, third])


def map_coordinates(axes: ArrayLike, vectors_b: np.ndarray) -> np.ndarray:
    """(N, 2) azimuth, 0 to 360, and polar angle from the array normal [deg] of vectors (N, 3) in b."""
    x, y, z = np.array(axes) @ np.asarray(vectors_b).T
    azimuth = np.degrees(np.arctan2(y, x)) % 360.0
    return np.column_stack([azimuth, np.degrees(np.arctan2(np.hypot(x, y), z))])
