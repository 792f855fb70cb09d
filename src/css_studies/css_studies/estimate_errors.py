# SPDX-License-Identifier: Apache-2.0
"""How far the estimates of a flight are from its truth, step by step, and whether they know it."""

import numpy as np

from css_msgs.msg import SunEstimate
from css_studies.flight_log import FlightLog, angle


def estimated_rows(log: FlightLog, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Rows (K,) of an estimator's columns that hold an estimate, and their steps (K,) of the truth."""
    estimates = log.estimates[name]
    rows, steps = log.truth_rows(estimates)
    exists = estimates.validity[rows] != SunEstimate.VALIDITY_NONE
    return rows[exists], steps[exists]


def heading_errors(log: FlightLog, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Steps of the truth (K,) that have an estimate, and angles (K,) [rad] of estimated to true Sun there."""
    estimates = log.estimates[name]
    rows, steps = estimated_rows(log, name)
    return steps, angle(estimates.sun_b[rows], log.sun_b[steps])


def rate_errors(log: FlightLog, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Steps of the truth (K,) and norms (K,) [rad/s] of the error of the estimated body rate there."""
    estimates = log.estimates[name]
    rows, steps = log.truth_rows(estimates)
    known = estimates.rate_source[rows] != SunEstimate.RATE_NONE
    rows, steps = rows[known], steps[known]
    return steps, np.linalg.norm(estimates.omega_bn_b[rows] - log.having("truth").omega_bn_b[steps], axis=1)


def tangent_nees(log: FlightLog, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Steps of the truth (K,) and normalised error squared (K,) on the two axes across the estimated Sun.

    The length of the state is a constraint, so a consistent filter gives a chi-square variable of two degrees
    of freedom (Bar-Shalom, Li & Kirubarajan, section 5.4). Only estimates with a covariance count.
    """
    estimates = log.estimates[name]
    rows, steps = estimated_rows(log, name)
    has_covariance = estimates.covariance[rows, 0] >= 0.0
    rows, steps = rows[has_covariance], steps[has_covariance]
    sun_b = estimates.sun_b[rows]
    covariance = estimates.covariance[rows].reshape(-1, 3, 3)
    # two axes across each Sun line, from the body axis that is farthest from it
    helper = np.eye(3)[np.argmin(np.abs(sun_b), axis=1)]
    first = np.cross(helper, sun_b)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    axes = np.stack([first, np.cross(sun_b, first)], axis=1)  # (K, 2, 3)
    error = np.einsum("kij,kj->ki", axes, log.sun_b[steps] - sun_b)
    tangent = axes @ covariance @ axes.transpose(0, 2, 1)
    return steps, np.einsum("ki,ki->k", error, np.linalg.solve(tangent, error[..., None])[..., 0])
