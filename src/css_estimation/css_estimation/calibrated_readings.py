# SPDX-License-Identifier: Apache-2.0
"""What sensors read once a calibration of theirs is taken off: `measured` in the sections cells, gyro and magnetometer.

    cells: (v - dark) / scale,    gyro: omega - bias,    magnetometer: M^-1 (b - bias)

Where nothing was calibrated the readings are handed on as they are, to the last bit. The normals that a calibration
found are `css_sensors.cells.known_normals`. A temperature coefficient acts where a temperature is known, which is not
here.
"""

from typing import Any, NamedTuple

import numpy as np

from css_common.kernel import kernel
from css_common.matrices import IDENTITY
from css_common.schema import Values
from css_common.sections import MEASURED_FIELD_BIAS, MEASURED_FIELD_MATRIX, MEASURED_GYRO_BIAS
from css_common.vectors import Mat3, Vec3, mat3, vector_of
from css_sensors.cells import MEASURED_DARKS, MEASURED_NORMALS, MEASURED_SCALES


class Corrections(NamedTuple):
    """What a calibration found of the sensors of one spacecraft; a sensor that none looked at keeps its readings."""

    of_cells: bool
    scales: np.ndarray  # (N,) [-]
    darks: np.ndarray  # (N,) [-]
    of_gyro: bool
    gyro_bias: Vec3  # [rad/s]
    of_field: bool
    field_bias: Vec3  # [T]
    field_inverse: Mat3  # of the matrix of scales and soft iron


_NOTHING = Corrections(False, np.zeros(0), np.zeros(0), False, (0.0, 0.0, 0.0), False, (0.0, 0.0, 0.0), IDENTITY)


def corrections(values: Values | None) -> Corrections:
    """Takes the sections cells, gyro and magnetometer; None: of who reads nothing."""
    if values is None:
        return _NOTHING
    count = len(values.cells.normals)
    scales, darks = values[MEASURED_SCALES], values[MEASURED_DARKS]
    bias, field_bias, matrix = values[MEASURED_GYRO_BIAS], values[MEASURED_FIELD_BIAS], values[MEASURED_FIELD_MATRIX]
    return Corrections(
        bool(len(scales) or len(darks)),
        np.asarray(scales if len(scales) else np.ones(count), dtype=np.float64),
        np.asarray(darks if len(darks) else np.zeros(count), dtype=np.float64),
        bool(len(bias)),
        vector_of(np.radians(bias[0]) / 3600.0 if len(bias) else np.zeros(3)),
        bool(len(field_bias) or len(matrix)),
        vector_of(1e-9 * field_bias[0] if len(field_bias) else np.zeros(3)),
        mat3(np.linalg.inv(matrix) if len(matrix) else np.eye(3)),
    )


# In Python the three are for arrays, too: what a study computes for one cycle, replay computes for all of a recording.
@kernel
def corrected_output(output, dark, scale):  # noqa: ANN201
    """Of a cell [-]."""
    return (output - dark) / scale


@kernel
def corrected_rate(c: Corrections, x, y, z):  # noqa: ANN201
    """Three components [rad/s], read as x, y, z."""
    return x - c.gyro_bias[0], y - c.gyro_bias[1], z - c.gyro_bias[2]


@kernel
def corrected_field(c: Corrections, x, y, z):  # noqa: ANN201
    """Three components [T], read as x, y, z."""
    x, y, z = x - c.field_bias[0], y - c.field_bias[1], z - c.field_bias[2]
    a, b, d = c.field_inverse
    return a[0] * x + a[1] * y + a[2] * z, b[0] * x + b[1] * y + b[2] * z, d[0] * x + d[1] * y + d[2] * z


@kernel
def correct_cells(c: Corrections, voltages, out) -> None:
    """Outputs (N,) as corrected, written; only where `of_cells`."""
    for i in range(voltages.shape[0]):
        out[i] = corrected_output(voltages[i], c.darks[i], c.scales[i])


@kernel
def heard_rate(c: Corrections, rate_b: Vec3, valid: bool) -> Vec3:
    """A body rate as an estimator gets it."""
    if valid and c.of_gyro:
        return corrected_rate(c, rate_b[0], rate_b[1], rate_b[2])
    return rate_b


@kernel
def heard_field(c: Corrections, field_b: Vec3, valid: bool) -> Vec3:
    """A field as an estimator gets it."""
    if valid and c.of_field:
        return corrected_field(c, field_b[0], field_b[1], field_b[2])
    return field_b


class CalibratedReadings:
    """Corrections of one spacecraft, for its nodes."""

    def __init__(self, values: Values) -> None:
        """Takes the sections cells, gyro and magnetometer."""
        self._c = corrections(values)

    def cells(self, voltages: np.ndarray) -> np.ndarray:
        """Outputs (..., N)."""
        c = self._c
        return np.asarray(corrected_output.py_func(voltages, c.darks, c.scales)) if c.of_cells else voltages

    def rates(self, rates_b: np.ndarray) -> np.ndarray:
        """Body rates (..., 3) [rad/s]."""
        return self._of_each(corrected_rate, rates_b) if self._c.of_gyro else rates_b

    def fields(self, fields_b: np.ndarray) -> np.ndarray:
        """Fields (..., 3) [T]."""
        return self._of_each(corrected_field, fields_b) if self._c.of_field else fields_b

    def rate(self, rate_b: Vec3) -> Vec3:
        """One body rate."""
        return vector_of(self.rates(np.array(rate_b))) if self._c.of_gyro else rate_b

    def field(self, field_b: Vec3) -> Vec3:
        """One field."""
        return vector_of(self.fields(np.array(field_b))) if self._c.of_field else field_b

    def _of_each(self, corrected: Any, vectors: np.ndarray) -> np.ndarray:
        return np.stack(corrected.py_func(self._c, *np.moveaxis(vectors, -1, 0)), axis=-1)


def is_calibrated(values: Values) -> bool:
    """Whether readings are corrected, or normals are others than those of the layout."""
    parameters = (
        MEASURED_NORMALS,
        MEASURED_SCALES,
        MEASURED_DARKS,
        MEASURED_GYRO_BIAS,
        MEASURED_FIELD_BIAS,
        MEASURED_FIELD_MATRIX,
    )
    return any(parameter in values and len(values[parameter]) for parameter in parameters)
