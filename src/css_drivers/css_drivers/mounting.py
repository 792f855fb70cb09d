# SPDX-License-Identifier: Apache-2.0
"""How a sensor of somebody else's sits in the body: its axes, its unit, its clock."""

import math
from collections.abc import Iterator

import numpy as np

from css_common.schema import Parameter, Table, Values, choice, real, reals, text

AXES = text(
    "axes",
    "x y z",
    "which axis of the sensor each of the body's x, y and z is, with its sign, for instance -y x z",
)
MOUNTING = reals(
    "mounting",
    (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
    "-",
    "rotation that comes after that, row-major: what turns these axes into those of the body",
    length=9,
    columns=3,
)
SENSOR_FRAME = text("sensor_frame", "", "frame_id of the sensor's messages; empty: io.body_frame")
STAMPS = choice(
    "stamps", "sensor", ("sensor", "arrival"), "sensor: as they are; arrival: when a message comes, for drivers without"
)
MAX_AGE = real("max_age", 0.5, "s", "a message older than that when it comes is left out", low=0.001, high=1e6)

COMMON: Table = (AXES, MOUNTING, SENSOR_FRAME, STAMPS, MAX_AGE)

_SIGNED = {
    f"{sign}{name}": (i, value) for i, name in enumerate("xyz") for sign, value in (("", 1.0), ("+", 1.0), ("-", -1.0))
}
_ORTHOGONAL = 1e-6


def unit_parameter(units: dict[str, float], usual: str) -> Parameter[str]:
    """The unit that a sensor's messages are in, whatever their type says."""
    return choice("unit", usual, tuple(units), "what the numbers of its messages are in")


def permutation(axes: str) -> np.ndarray:
    """Matrix (3, 3) that takes components along the sensor's axes to those named.

    Raises:
        KeyError: a name that is none.
    """
    matrix = np.zeros((3, 3))
    for row, name in enumerate(axes.lower().split()):
        column, sign = _SIGNED[name]
        matrix[row, column] = sign
    return matrix


def sensor_to_body(values: Values) -> np.ndarray:
    """Matrix (3, 3) that takes components along the sensor's axes to the body's."""
    return values[MOUNTING] @ permutation(values[AXES])


def conflicts(values: Values) -> Iterator[str]:
    """What is wrong between the values, one message each."""
    axes = values[AXES]
    names = axes.lower().split()
    if len(names) != 3 or any(name not in _SIGNED for name in names):
        yield f"axes: {axes} given, expected three of x, y, z with or without a -, for instance -y x z"
        return
    matrix = permutation(axes)
    if np.any(np.abs(matrix).sum(axis=0) != 1.0):
        yield f"axes: {axes} given, expected each of x, y and z once"
    elif np.linalg.det(matrix) < 0.0:
        yield (
            f"axes: {axes} given, which mirrors: no way to mount a sensor does that; expected an even number of "
            "exchanges and signs, or the sensor's own left-handed axes put right in its driver"
        )
    rotation = values[MOUNTING]
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=_ORTHOGONAL) or np.linalg.det(rotation) < 0.0:
        yield "mounting: no rotation, expected an orthogonal matrix of determinant 1"


def turned_covariance(matrix: np.ndarray, covariance: np.ndarray, scale: float) -> np.ndarray:
    """Covariance (9,) of a turned and scaled vector; what says that there is none, or nothing known, stays."""
    if covariance[0] == -1.0 or not np.any(covariance) or not np.all(np.isfinite(covariance)):
        return np.where(np.isfinite(covariance), covariance, 0.0)
    return (scale * scale * matrix @ covariance.reshape(3, 3) @ matrix.T).ravel()


DEGREE = math.radians(1.0)
