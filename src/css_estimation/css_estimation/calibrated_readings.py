# SPDX-License-Identifier: Apache-2.0
"""What sensors read once a calibration of theirs is taken off: `measured` in the sections cells, gyro and magnetometer.

    cells: (v - dark) / scale,    gyro: omega - bias,    magnetometer: M^-1 (b - bias)

Where nothing was calibrated the readings are handed on as they are, to the last bit. The normals that a calibration
found are `css_sensors.cells.known_normals`. A temperature coefficient acts where a temperature is known, which is not
here.
"""

import numpy as np

from css_common.schema import Values
from css_common.sections import MEASURED_FIELD_BIAS, MEASURED_FIELD_MATRIX, MEASURED_GYRO_BIAS
from css_common.vectors import Vec3, vector_of
from css_sensors.cells import MEASURED_DARKS, MEASURED_NORMALS, MEASURED_SCALES


class CalibratedReadings:
    """Corrections of one spacecraft."""

    def __init__(self, values: Values) -> None:
        """Takes the sections cells, gyro and magnetometer."""
        count = len(values.cells.normals)
        scales, darks = values[MEASURED_SCALES], values[MEASURED_DARKS]
        self._of_cells = bool(len(scales) or len(darks))
        self._scales = np.asarray(scales if len(scales) else np.ones(count), dtype=np.float64)
        self._darks = np.asarray(darks if len(darks) else np.zeros(count), dtype=np.float64)
        bias = values[MEASURED_GYRO_BIAS]
        self._gyro_bias = np.radians(bias[0]) / 3600.0 if len(bias) else None
        field_bias, matrix = values[MEASURED_FIELD_BIAS], values[MEASURED_FIELD_MATRIX]
        self._field_bias = 1e-9 * field_bias[0] if len(field_bias) else np.zeros(3)
        self._inverse = np.linalg.inv(matrix) if len(matrix) else np.eye(3)
        self._of_field = bool(len(field_bias) or len(matrix))

    def cells(self, voltages: np.ndarray) -> np.ndarray:
        """Outputs (..., N)."""
        return (voltages - self._darks) / self._scales if self._of_cells else voltages

    def rates(self, rates_b: np.ndarray) -> np.ndarray:
        """Body rates (..., 3) [rad/s]."""
        return rates_b if self._gyro_bias is None else rates_b - self._gyro_bias

    def fields(self, fields_b: np.ndarray) -> np.ndarray:
        """Fields (..., 3) [T]."""
        return (fields_b - self._field_bias) @ self._inverse.T if self._of_field else fields_b

    def rate(self, rate_b: Vec3) -> Vec3:
        """One body rate."""
        return rate_b if self._gyro_bias is None else vector_of(self.rates(np.array(rate_b)))

    def field(self, field_b: Vec3) -> Vec3:
        """One field."""
        return vector_of(self.fields(np.array(field_b))) if self._of_field else field_b


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
