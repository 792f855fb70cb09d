# SPDX-License-Identifier: Apache-2.0
"""Errors of gyro and magnetometer where the truth is recorded: linear least squares, robust, with priors."""

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from css_calibration.attitude_guess import integrated
from css_calibration.attitude_track import (
    BIAS,
    COMMON_SIGMA,
    FIELD_BIAS,
    SOFT_IRON,
    crossing,
    turned_by,
)
from css_calibration.recorded import Recorded
from css_calibration.surroundings import Surroundings

_SPACING_S = 10.0  # between the instants that the gyro is held against
_FEWEST = 10
_OUTLIER = 5.0


class Linear(NamedTuple):
    """Result of a linear fit."""

    x: np.ndarray  # (P,) in SI units
    sigma: np.ndarray  # (P,)
    left: np.ndarray  # (P,) sigma over what was known before
    outliers: int  # rows left out
    rows: int


def linear_fit(matrix: np.ndarray, target: np.ndarray, before: np.ndarray) -> Linear:
    """Least squares of matrix (R, P) x = target (R,), soft-L1 first, then without what is beyond 5 sigma.

    Args:
        before: (P,) what is known of x before, 1 sigma about zero.
    """
    scaled = matrix * before
    noise = max(1.4826 * float(np.median(np.abs(target - np.median(target)))), 1e-15)
    x = np.zeros(matrix.shape[1])
    kept = np.ones(len(target), np.bool_)
    for loss in ("soft_l1", "linear", "linear"):
        a, b = scaled[kept] / noise, target[kept] / noise

        def residuals(x: np.ndarray, a: np.ndarray = a, b: np.ndarray = b) -> np.ndarray:
            return np.concatenate([a @ x - b, x])

        jacobian = np.vstack([a, np.eye(len(x))])
        x = least_squares(residuals, x, jac=lambda _, j=jacobian: j, loss=loss, f_scale=2.0).x
        off = scaled @ x - target
        noise = max(1.4826 * float(np.median(np.abs(off))), 1e-15)
        kept = np.abs(off) < _OUTLIER * noise
    freedom = max(1, int(kept.sum()) - len(x))
    noise = max(noise, float(np.sqrt(np.sum(off[kept] ** 2) / freedom)))
    covariance = np.linalg.inv(scaled[kept].T @ scaled[kept] / noise**2 + np.eye(len(x)))
    left = np.sqrt(np.diag(covariance))
    return Linear(x * before, left * before, left, int((~kept).sum()), len(target))


def gyro_bias(recorded: Recorded) -> Linear | None:
    """Bias (3,) [rad/s] by the true attitude, else by the true Sun; None where there are too few rates."""
    if len(recorded.gyro_ns) < _FEWEST or recorded.sun_b is None:
        return None
    step = max(1, round(_SPACING_S / recorded.period_s))
    some = recorded.at(np.arange(0, len(recorded.stamp_ns), step))
    phi, integral, stretch = integrated(some)
    assert some.sun_b is not None
    known = (stretch >= 0) & np.isfinite(some.sun_b).all(axis=1)
    pairs = np.flatnonzero(known[1:] & known[:-1] & (stretch[1:] == stretch[:-1]))
    if len(pairs) < _FEWEST:
        return None
    moved = integral[pairs + 1] - integral[pairs]
    if some.dcm_bn is not None:
        e = phi.transpose(0, 2, 1) @ np.where(known[:, None, None], some.dcm_bn, np.eye(3))
        target = -turned_by(e[pairs + 1] @ e[pairs].transpose(0, 2, 1))
        return linear_fit(moved.reshape(-1, 3), target.ravel(), COMMON_SIGMA[BIAS])
    e = np.einsum("kji,kj->ki", phi, np.where(known[:, None], some.sun_b, 0.0))
    matrix = -crossing(e[pairs]) @ moved
    return linear_fit(matrix.reshape(-1, 3), (e[pairs + 1] - e[pairs]).ravel(), COMMON_SIGMA[BIAS])


def magnetometer(recorded: Recorded, around: Surroundings) -> Linear | None:
    """Bias [T], scale and soft iron (9,) by the true attitude and the field at its place; None without them."""
    if recorded.field_b is None or recorded.dcm_bn is None:
        return None
    good = np.isfinite(recorded.field_b).all(axis=1) & np.isfinite(recorded.dcm_bn).all(axis=(1, 2))
    good &= np.isfinite(around.field_n).all(axis=1)
    rows = np.flatnonzero(good)
    if len(rows) < _FEWEST:
        return None
    true_b = np.einsum("kij,kj->ki", recorded.dcm_bn[rows], around.field_n[rows])
    matrix = np.zeros((len(rows), 3, 9))
    for j in range(3):
        matrix[:, j, j] = 1.0
        matrix[:, j, 3 + j] = true_b[:, j]
    for place, (i, j) in enumerate(((0, 1), (0, 2), (1, 2))):
        matrix[:, i, 6 + place] = true_b[:, j]
        matrix[:, j, 6 + place] = true_b[:, i]
    before = COMMON_SIGMA[FIELD_BIAS.start : SOFT_IRON.stop]
    return linear_fit(matrix.reshape(-1, 9), (recorded.field_b[rows] - true_b).ravel(), before)
