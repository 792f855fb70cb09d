# SPDX-License-Identifier: Apache-2.0
"""Vectors and attitudes of a table in Sunpoint's frames: b and n, sigma_bn."""

import numpy as np

from css_common.attitude import dcm_to_mrp, quaternion_to_mrp
from css_common.kernel import kernel
from css_common.vectors import row
from css_telemetry.columns import Readings
from css_telemetry.description import AttitudeForm, VectorForm
from css_telemetry.faults import Broken

_LENGTH_TOLERANCE = 0.05  # of a quaternion, or of the rows of a matrix, given with few digits
_PLACES = {"x": 0, "y": 1, "z": 2}


def vectors_of(readings: Readings, form: VectorForm) -> np.ndarray:
    """(N, 3) vectors in b in SI units; a vector of which a component is missing is missing (NaN)."""
    given = readings.matrix(form.columns) * form.factor
    given[np.isnan(given).any(axis=1)] = np.nan
    vectors = np.empty_like(given)
    for index, axis in enumerate(form.axes):
        sign = -1.0 if axis[0] == "-" else 1.0
        vectors[:, _PLACES[axis[1]]] = sign * given[:, index] + 0.0  # no negative zeros
    return vectors


def directions_of(readings: Readings, form: VectorForm) -> np.ndarray:
    """(N, 3) unit vectors in b; what has no length is no direction, counted and missing (NaN)."""
    vectors = vectors_of(readings, form)
    length = np.linalg.norm(vectors, axis=1)
    none = np.isfinite(length) & (length == 0.0)
    detail = f"columns {', '.join(form.columns)}: expected a direction, found no length"
    for index in np.flatnonzero(none).tolist():
        readings.account.repair(int(readings.lines[index]), Broken("no direction", detail))
    good = np.isfinite(length) & (length > 0.0)
    result = np.full_like(vectors, np.nan)
    result[good] = vectors[good] / length[good, np.newaxis]
    return result


def attitudes_of(readings: Readings, form: AttitudeForm) -> np.ndarray:
    """(N, 3) sigma_bn, |sigma| <= 1; NaN where the attitude is missing, or no rotation, which is counted."""
    given = readings.matrix(form.columns)
    complete = np.isfinite(given).all(axis=1)
    sigma = np.full((len(given), 3), np.nan)
    good = complete & (_are_matrices(given) if form.order == "matrix" else _are_quaternions(given))
    detail = f"columns {', '.join(form.columns)}: no rotation"
    for index in np.flatnonzero(complete & ~good).tolist():
        readings.account.repair(int(readings.lines[index]), Broken("no rotation", detail))
    rows = np.flatnonzero(good)
    out = np.empty((len(rows), 3))
    if form.order == "matrix":
        dcm = given[rows].reshape(-1, 3, 3)
        if form.direction == "body_to_inertial":
            dcm = dcm.transpose(0, 2, 1)
        left, _, right = np.linalg.svd(dcm)  # the nearest rotation, as few digits are given
        _of_matrices(np.ascontiguousarray(left @ right), out)
    else:
        q = given[rows][:, [1, 2, 3, 0]] if form.order == "wxyz" else given[rows]
        q = q / np.linalg.norm(q, axis=1, keepdims=True)
        if form.direction == "body_to_inertial":
            q = q * np.array([-1.0, -1.0, -1.0, 1.0])
        _of_quaternions(np.ascontiguousarray(q), out)
    sigma[rows] = out + 0.0
    return sigma


def _are_quaternions(given: np.ndarray) -> np.ndarray:
    return np.abs(np.linalg.norm(given, axis=1) - 1.0) <= _LENGTH_TOLERANCE


def _are_matrices(given: np.ndarray) -> np.ndarray:
    dcm = np.where(np.isfinite(given), given, 0.0).reshape(-1, 3, 3)
    off = np.abs(dcm @ dcm.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    return (off <= _LENGTH_TOLERANCE) & (np.linalg.det(dcm) > 0.0)


@kernel
def _of_quaternions(q, sigma_out) -> None:
    for i in range(q.shape[0]):
        s = quaternion_to_mrp((q[i, 0], q[i, 1], q[i, 2], q[i, 3]))
        sigma_out[i, 0], sigma_out[i, 1], sigma_out[i, 2] = s


@kernel
def _of_matrices(dcm, sigma_out) -> None:
    for i in range(dcm.shape[0]):
        d = dcm[i]
        s = dcm_to_mrp((row(d, 0), row(d, 1), row(d, 2)))
        sigma_out[i, 0], sigma_out[i, 1], sigma_out[i, 2] = s
