# SPDX-License-Identifier: Apache-2.0
"""How far the estimates of a flight are from its truth, step by step, and whether they know it."""

import math

import numpy as np

from css_analysis.flight_log import FlightLog, angle
from css_common.attitude import (
    mrp_add,
    mrp_angle,
    mrp_subtract,
    mrp_to_rotation_vector,
    quaternion_to_mrp,
    rotation_vector_to_mrp,
)
from css_common.kernel import kernel
from css_common.vectors import Vec3, axes_across, dot, multiply, row, subtract
from css_estimation.sun.error_covariance import attitude_block
from css_estimation.symmetric import inverse_form
from css_msgs.msg import AttitudeEstimate, SunEstimate


def estimated_rows(log: FlightLog, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Rows (K,) of an estimator's columns that hold an estimate, and their steps (K,) of the truth."""
    is_attitude = name in log.attitudes
    estimates = log.attitudes[name] if is_attitude else log.estimates[name]
    rows, steps = log.truth_rows(estimates)
    none = AttitudeEstimate.VALIDITY_NONE if is_attitude else SunEstimate.VALIDITY_NONE
    exists = estimates.validity[rows] != none
    return rows[exists], steps[exists]


def heading_errors(log: FlightLog, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Steps of the truth (K,) that have an estimate, and angles (K,) [rad] of estimated to true Sun there."""
    estimates = log.estimates[name]
    rows, steps = estimated_rows(log, name)
    return steps, angle(estimates.sun_b[rows], log.sun_b[steps])


def tangent_nees(log: FlightLog, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Steps of the truth (K,) and normalised error squared (K,) on the two axes across the estimated Sun.

    The length of the state is a constraint, so a consistent filter gives a chi-square variable of two degrees
    of freedom (Bar-Shalom, Li & Kirubarajan, section 5.4). Only estimates with a covariance count.
    """
    estimates = log.estimates[name]
    rows, steps = estimated_rows(log, name)
    has_covariance = estimates.covariance[rows, 0] >= 0.0
    rows, steps = rows[has_covariance], steps[has_covariance]
    nees = np.empty(len(rows))
    _tangent_nees_of_rows(estimates.sun_b[rows], estimates.covariance[rows], log.sun_b[steps], nees)
    return steps, nees


@kernel
def tangent_nees_of(sun_hat_b: Vec3, covariance, sun_b: Vec3) -> float:
    """Normalised error squared of one estimate `sun_hat_b` with its covariance (nine, row-major), as `tangent_nees`."""
    e1, e2 = axes_across(sun_hat_b)
    p11, p12, p22 = _across(e1, e2, covariance)
    error = subtract(sun_b, sun_hat_b)
    a, b = dot(e1, error), dot(e2, error)
    return (p22 * a * a - 2.0 * p12 * a * b + p11 * b * b) / (p11 * p22 - p12 * p12)


@kernel
def _across(e1: Vec3, e2: Vec3, c) -> Vec3:
    """Covariance (nine, row-major) on two axes: first variance, covariance, second variance."""
    p = ((c[0], c[1], c[2]), (c[3], c[4], c[5]), (c[6], c[7], c[8]))
    p_e2 = multiply(p, e2)
    return dot(e1, multiply(p, e1)), dot(e1, p_e2), dot(e2, p_e2)


@kernel
def heading_sigma_of(sun_hat_b: Vec3, covariance) -> float:
    """One sigma [rad] of one estimate `sun_hat_b` by its covariance (nine, row-major), as `heading_sigmas`."""
    e1, e2 = axes_across(sun_hat_b)
    p11, p12, p22 = _across(e1, e2, covariance)
    middle, half = 0.5 * (p11 + p22), 0.5 * (p11 - p22)
    return math.sqrt(max(middle + math.sqrt(half * half + p12 * p12), 0.0))


@kernel
def _heading_sigmas_of_rows(sun_hat_b, covariance, sigmas_out) -> None:
    for i in range(sigmas_out.shape[0]):
        sigmas_out[i] = heading_sigma_of(row(sun_hat_b, i), covariance[i])


def heading_sigmas(log: FlightLog, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Steps of the truth (K,) and what a filter itself holds for one sigma (K,) [rad] of its Sun there.

    It is the larger half axis of its error ellipse across the estimated Sun. Only estimates with a covariance count.
    """
    estimates = log.estimates[name]
    rows, steps = estimated_rows(log, name)
    has_covariance = estimates.covariance[rows, 0] >= 0.0
    rows, steps = rows[has_covariance], steps[has_covariance]
    sigmas = np.empty(len(rows))
    _heading_sigmas_of_rows(estimates.sun_b[rows], estimates.covariance[rows], sigmas)
    return steps, sigmas


def attitude_sigmas(log: FlightLog, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Steps of the truth (K,) and what an attitude filter holds for one sigma (K,) [rad] of its attitude there.

    It is the largest half axis of the error ellipsoid of its rotation vector.
    """
    rows, steps = estimated_rows(log, name)
    covariance = log.attitudes[name].covariance[rows].reshape(-1, 6, 6)[:, :3, :3]
    known = np.isfinite(covariance).all(axis=(1, 2)) & (covariance[:, 0, 0] >= 0.0)
    rows, steps, covariance = rows[known], steps[known], covariance[known]
    return steps, np.sqrt(np.maximum(np.linalg.eigvalsh(covariance)[:, -1], 0.0)) if len(rows) else np.empty(0)


@kernel
def _tangent_nees_of_rows(sun_hat_b, covariance, sun_b, nees_out) -> None:
    for i in range(nees_out.shape[0]):
        nees_out[i] = tangent_nees_of(row(sun_hat_b, i), covariance[i], row(sun_b, i))


def attitude_errors(log: FlightLog, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors of an attitude filter at the steps of the truth that have an attitude.

    Returns:
        Steps (K,); angles (K,) [rad] of the Euler rotation from the estimated to the true attitude; normalised errors
        squared (K,), chi-square of three degrees of freedom if consistent.
    """
    attitudes = log.attitudes[name]
    rows, steps = estimated_rows(log, name)
    errors, nees = np.empty(len(rows)), np.empty(len(rows))
    covariance = attitudes.covariance[rows].reshape(-1, 6, 6)
    true = true_attitudes(log, steps, attitudes.delay[rows])
    _attitude_errors_of_rows(attitudes.q_bn[rows], covariance, true, errors, nees)
    return steps, errors, nees


def true_attitudes(log: FlightLog, steps: np.ndarray, delay: np.ndarray) -> np.ndarray:
    """(K, 3) sigma_bn so long (K,) [s] before steps (K,) of the truth: the next step's, turned back by its rate."""
    truth = log.having("truth")
    if not np.any(delay > 0.0):
        return truth.sigma_bn[steps]
    time = log.time(truth)
    instant = time[steps] - delay
    # a nanosecond of slack: an instant that is a step's is that step's
    after = np.clip(np.searchsorted(time, instant - 1e-9), 0, len(time) - 1)
    back = (time[after] - instant)[:, None]
    # the rate in the middle of the way
    before = np.maximum(after - 1, 0)
    share = 0.5 * back / max(log.period, 1e-9)
    rate = (1.0 - share) * truth.omega_bn_b[after] + share * truth.omega_bn_b[before]
    attitudes = np.empty((len(steps), 3))
    _turned(truth.sigma_bn[after], -back * rate, attitudes)
    return attitudes


@kernel
def _turned(sigma_bn, angles_b, sigma_out) -> None:
    for i in range(sigma_out.shape[0]):
        s = mrp_add(row(sigma_bn, i), rotation_vector_to_mrp(row(angles_b, i)))
        sigma_out[i, 0], sigma_out[i, 1], sigma_out[i, 2] = s


@kernel
def _attitude_errors_of_rows(q_bn, covariance, sigma_bn, errors_out, nees_out) -> None:
    for i in range(errors_out.shape[0]):
        estimated = quaternion_to_mrp((q_bn[i, 0], q_bn[i, 1], q_bn[i, 2], q_bn[i, 3]))
        difference = mrp_subtract(row(sigma_bn, i), estimated)
        errors_out[i] = mrp_angle(difference)
        nees_out[i] = inverse_form(attitude_block(covariance[i]), mrp_to_rotation_vector(difference))
