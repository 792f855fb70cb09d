# SPDX-License-Identifier: Apache-2.0
"""Figures of merit of each case with an attitude filter, gathered while it flies.

Error is the angle of the Euler rotation from the estimated to the true attitude (DiGregorio & Crassidis). NEES is the
normalised error squared of the attitude, chi-square with three degrees of freedom for a consistent filter, and of
attitude and bias together, with six (Bar-Shalom, Li & Kirubarajan, section 5.4).
"""

import math
from typing import Any, NamedTuple

import numpy as np

from css_common.attitude import mrp_angle, mrp_subtract, mrp_to_rotation_vector
from css_common.kernel import kernel
from css_common.vectors import Vec3, norm, subtract
from css_estimation.attitude.attitude_solution import VALIDITY_NONE, AttitudeSolution
from css_estimation.sun.error_covariance import attitude_block
from css_estimation.symmetric import inverse_form, trace
from css_monte_carlo.case_tallies import BIN_DEG, BINS, SUNLIT, sample_count
from css_monte_carlo.health_tallies import ActuatorsLeft
from css_monte_carlo.step_truth import Truth

_DEG = 180.0 / math.pi

SAMPLED = ("attitude_error_deg", "attitude_sigma_deg", "gyro_bias_error_deg_s", "cells_lit")
"""Quantities kept against time: error, its standard deviation by the filter, error of the bias, cells that count."""

TALLY = np.dtype(
    [(name, np.int64) for name in ("first_step", "settled", "innovations", "without_estimate")]
    + [(name, np.float64) for name in ("error_sum", "error_max", "nees3_sum", "nees6_sum", "nis_sum", "bias_sum")],
    align=True,
)
"""Running sums of one case; angles in deg, rates in deg/s."""


ESTIMATE_COLUMNS = 9
"""Columns of a trace that hold the estimate: sigma_bn, omega_bn_b and the gyro's bias."""


class AttitudeTallies(NamedTuple):
    """Running figures of C cases."""

    totals: np.ndarray  # (C,) of TALLY
    histogram: np.ndarray  # (C, bins) settled errors
    samples: np.ndarray  # (C, quantities, S) float32
    settled_step: int
    sample_every: int
    work: np.ndarray  # (6, 7) room for an elimination


def new_tallies(cases: int, steps: int, period_s: float, sample_every: int, settled_time: float) -> AttitudeTallies:
    """Nothing seen yet, for flights of so many steps; filters count as settled from `settled_time` [s] on."""
    totals = np.zeros(cases, TALLY)
    totals["first_step"] = -1
    return AttitudeTallies(
        totals,
        np.zeros((cases, BINS), np.int64),
        np.full((cases, len(SAMPLED), sample_count(steps, sample_every)), np.nan, np.float32),
        math.ceil(settled_time / period_s - 1e-9),
        sample_every,
        np.zeros((6, 7)),
    )


@kernel
def note_estimate(heading, attitude: AttitudeSolution, out) -> None:
    """Writes the `ESTIMATE_COLUMNS` of a trace."""
    for i in range(3):
        out[i], out[3 + i], out[6 + i] = attitude.sigma_bn[i], attitude.omega_bn_b[i], attitude.bias_b[i]


@kernel
def tally_step(
    tallies: AttitudeTallies,
    c: int,
    step: int,
    marks: int,
    truth: Truth,
    heading,
    attitude: AttitudeSolution,
    memory: Any,
    left: ActuatorsLeft,
) -> None:
    """Counts one step of case `c`.

    Args:
        marks: of the step, see `case_tallies.step_marks`.
        heading: of a Sun estimator, not read.
        attitude, memory: what the filter says; of its memory the `covariance` (n, n) is read.
        left: actuators that the control holds for failed, not read.
    """
    t = tallies.totals[c]
    if attitude.validity == VALIDITY_NONE:
        if (marks & SUNLIT) != 0:
            t.without_estimate += 1
        return
    if t.first_step < 0:
        t.first_step = step
    covariance = memory.covariance
    difference = mrp_subtract(truth.sigma_bn, attitude.sigma_bn)
    error = _DEG * mrp_angle(difference)
    bias_error_b = subtract(truth.gyro_bias_b, attitude.bias_b)
    bias_error = _DEG * norm(bias_error_b)
    if step >= tallies.settled_step:
        t.settled += 1
        t.error_sum += error
        t.error_max = max(t.error_max, error)
        tallies.histogram[c, min(int(error / BIN_DEG), BINS - 1)] += 1
        t.bias_sum += bias_error
        turn = mrp_to_rotation_vector(difference)
        t.nees3_sum += inverse_form(attitude_block(covariance), turn)
        t.nees6_sum += _nees(tallies.work, covariance, turn, bias_error_b)
        t.innovations += attitude.nis_dof
        t.nis_sum += attitude.nis
    if step % tallies.sample_every == 0:
        at = step // tallies.sample_every
        samples = tallies.samples[c]
        samples[0, at], samples[1, at] = error, _DEG * math.sqrt(trace(attitude_block(covariance)))
        samples[2, at], samples[3, at] = bias_error, _count(attitude.lit_mask)


@kernel
def _count(mask: int) -> int:
    """Number of cells in a mask."""
    lit = 0
    for i in range(32):
        lit += mask >> i & 1
    return lit


@kernel
def _nees(work, covariance, attitude: Vec3, bias: Vec3) -> float:
    """e^T P^-1 e of attitude and bias, by Gaussian elimination of the positive definite P."""
    for i in range(6):
        for j in range(6):
            work[i, j] = covariance[i, j]
        work[i, 6] = attitude[i] if i < 3 else bias[i - 3]
    total = 0.0
    for i in range(6):
        pivot = work[i, i]
        if not pivot > 0.0:
            return math.inf
        total += work[i, 6] * work[i, 6] / pivot
        for j in range(i + 1, 6):
            factor = work[j, i] / pivot
            for k in range(i + 1, 7):
                work[j, k] -= factor * work[i, k]
    return total
