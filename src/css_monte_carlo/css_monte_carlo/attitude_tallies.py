# SPDX-License-Identifier: Apache-2.0
"""Figures of merit of attitude filters, gathered while cases fly.

Error is the angle of the Euler rotation from the estimated to the true attitude (DiGregorio & Crassidis). NEES is the
normalised error squared of the attitude, chi-square with three degrees of freedom for a consistent filter, and of
attitude and bias together, with six (Bar-Shalom, Li & Kirubarajan, section 5.4).
"""

import math
from typing import NamedTuple

import numpy as np

from css_common.attitude import mrp_angle, mrp_subtract, mrp_to_rotation_vector
from css_common.kernel import kernel
from css_common.vectors import Vec3, norm, subtract
from css_estimation.attitude.attitude_solution import VALIDITY_NONE, AttitudeSolution
from css_estimation.sun.error_covariance import attitude_block
from css_estimation.symmetric import inverse_form, trace

_DEG = 180.0 / math.pi

SAMPLED = ("error_deg", "sigma_deg", "bias_error_deg_s", "lit")
"""Quantities kept against time: error, its standard deviation by the filter, error of the bias, cells that count."""

TALLY = np.dtype(
    [(name, np.int64) for name in ("first_step", "settled", "innovations")]
    + [(name, np.float64) for name in ("error_sum", "error_max", "nees3_sum", "nees6_sum", "nis_sum", "bias_sum")],
    align=True,
)
"""Running sums of one filter in one case; angles in deg, rates in deg/s."""


class AttitudeTallies(NamedTuple):
    """Running figures of F filters in C cases."""

    totals: np.ndarray  # (F, C) of TALLY
    lit: np.ndarray  # (F, C, 33) settled steps by number of cells that contributed
    samples: np.ndarray  # (F, C, quantities, S) float32
    settled_step: int
    sample_every: int
    work: np.ndarray  # (6, 7) room for an elimination


def new_tallies(
    filters: int, cases: int, steps: int, period_s: float, sample_every: int, settled_time: float
) -> AttitudeTallies:
    """Nothing seen yet; filters count as settled from `settled_time` [s] on."""
    samples = (steps + sample_every - 1) // sample_every
    totals = np.zeros((filters, cases), TALLY)
    totals["first_step"] = -1
    return AttitudeTallies(
        totals,
        np.zeros((filters, cases, 33), np.int64),
        np.full((filters, cases, len(SAMPLED), samples), np.nan, np.float32),
        math.ceil(settled_time / period_s - 1e-9),
        sample_every,
        np.zeros((6, 7)),
    )


@kernel
def tally_attitude(
    tallies: AttitudeTallies,
    f: int,
    c: int,
    step: int,
    sigma_bn: Vec3,
    gyro_bias_b: Vec3,
    solution: AttitudeSolution,
    covariance,
) -> None:
    """Counts one step of filter `f` in case `c`.

    Args:
        sigma_bn, gyro_bias_b: the truth.
        solution, covariance: what the filter says.
    """
    if solution.validity == VALIDITY_NONE:
        return
    t = tallies.totals[f, c]
    if t.first_step < 0:
        t.first_step = step
    difference = mrp_subtract(sigma_bn, solution.sigma_bn)
    error = _DEG * mrp_angle(difference)
    bias_error_b = subtract(gyro_bias_b, solution.bias_b)
    bias_error = _DEG * norm(bias_error_b)
    lit = 0
    for i in range(32):
        lit += solution.lit_mask >> i & 1
    if step >= tallies.settled_step:
        t.settled += 1
        t.error_sum += error
        t.error_max = max(t.error_max, error)
        t.bias_sum += bias_error
        turn = mrp_to_rotation_vector(difference)
        t.nees3_sum += inverse_form(attitude_block(covariance), turn)
        t.nees6_sum += _nees(tallies.work, covariance, turn, bias_error_b)
        t.innovations += solution.nis_dof
        t.nis_sum += solution.nis
        tallies.lit[f, c, lit] += 1
    if step % tallies.sample_every == 0:
        at = step // tallies.sample_every
        samples = tallies.samples[f, c]
        samples[0, at], samples[1, at] = error, _DEG * math.sqrt(trace(attitude_block(covariance)))
        samples[2, at], samples[3, at] = bias_error, lit


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
