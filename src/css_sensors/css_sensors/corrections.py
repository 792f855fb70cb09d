# SPDX-License-Identifier: Apache-2.0
"""What a calibration makes of the readings of sensors, as kernels; `css_sensors.calibrated_readings` is for nodes.

cells: (v - dark) / scale,    gyro: omega - bias,    magnetometer: M^-1 (b - bias)
"""

from typing import Any, NamedTuple

import numpy as np

from css_common.kernel import kernel
from css_common.matrices import IDENTITY, inverse
from css_common.schema import Parameter, Values
from css_common.sections import MEASURED_FIELD_BIAS, MEASURED_FIELD_MATRIX, MEASURED_GYRO_BIAS
from css_common.vectors import Mat3, Vec3, mat3, vector_of
from css_sensors.cells import MEASURED_COEFFICIENTS, MEASURED_DARKS, MEASURED_SCALES


class Corrections(NamedTuple):
    """What a calibration found of the sensors of one spacecraft; a sensor that none looked at keeps its readings."""

    of_cells: bool
    scales: np.ndarray  # (N,) [-] at the reference temperature
    darks: np.ndarray  # (N,) [-]
    of_gyro: bool
    gyro_bias: Vec3  # [rad/s]
    of_field: bool
    field_bias: Vec3  # [T]
    field_inverse: Mat3  # of the matrix of scales and soft iron


_NOTHING = Corrections(False, np.zeros(0), np.zeros(0), False, (0.0, 0.0, 0.0), False, (0.0, 0.0, 0.0), IDENTITY)


def corrections(values: Values | None) -> Corrections:
    """Takes the sections cells, gyro and magnetometer, as far as they are there; None: of who reads nothing."""
    if values is None:
        return _NOTHING
    scales, darks = given(values, MEASURED_SCALES), given(values, MEASURED_DARKS)
    of_cells = bool(len(scales) or len(darks) or len(given(values, MEASURED_COEFFICIENTS)))
    count = len(values.cells.normals) if of_cells else 0
    bias = given(values, MEASURED_GYRO_BIAS)
    field_bias, matrix = given(values, MEASURED_FIELD_BIAS), given(values, MEASURED_FIELD_MATRIX)
    return Corrections(
        of_cells,
        scales if len(scales) else np.ones(count),
        darks if len(darks) else np.zeros(count),
        bool(len(bias)),
        vector_of(np.radians(bias[0]) / 3600.0 if len(bias) else np.zeros(3)),
        bool(len(field_bias) or len(matrix)),
        vector_of(1e-9 * field_bias[0] if len(field_bias) else np.zeros(3)),
        inverse(mat3(matrix)) if len(matrix) else IDENTITY,
    )


def given(values: Values, parameter: Parameter[Any]) -> np.ndarray:
    """A list of numbers, empty where a component does not have its section."""
    if parameter not in values:
        return np.zeros(0)
    return np.asarray(values[parameter], dtype=np.float64)


# Plain functions, also of arrays: what a study computes for one cycle, replay computes for all of a recording.
def of_output(output: Any, dark: Any, scale: Any) -> Any:
    """Output of a cell [-], corrected."""
    return (output - dark) / scale


def of_rate(c: Corrections, x: Any, y: Any, z: Any) -> Any:
    """Body rate [rad/s] of three components that are read, corrected."""
    return x - c.gyro_bias[0], y - c.gyro_bias[1], z - c.gyro_bias[2]


def of_field(c: Corrections, x: Any, y: Any, z: Any) -> Any:
    """Field [T] of three components that are read, corrected."""
    x, y, z = x - c.field_bias[0], y - c.field_bias[1], z - c.field_bias[2]
    a, b, d = c.field_inverse
    return a[0] * x + a[1] * y + a[2] * z, b[0] * x + b[1] * y + b[2] * z, d[0] * x + d[1] * y + d[2] * z


_output, _rate, _field = kernel(of_output), kernel(of_rate), kernel(of_field)


@kernel
def correct_cells(c: Corrections, voltages, out) -> None:
    """Outputs (N,) as corrected, written; only where `of_cells`."""
    for i in range(voltages.shape[0]):
        out[i] = _output(voltages[i], c.darks[i], c.scales[i])


@kernel
def heard_rate(c: Corrections, rate_b: Vec3, valid: bool) -> Vec3:
    """A body rate as an estimator gets it."""
    if valid and c.of_gyro:
        return _rate(c, rate_b[0], rate_b[1], rate_b[2])
    return rate_b


@kernel
def heard_field(c: Corrections, field_b: Vec3, valid: bool) -> Vec3:
    """A field as an estimator or a control gets it."""
    if valid and c.of_field:
        return _field(c, field_b[0], field_b[1], field_b[2])
    return field_b
