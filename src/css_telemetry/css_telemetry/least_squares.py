# SPDX-License-Identifier: Apache-2.0
"""Least squares in a few unknowns whose sums of squares may span twenty decades on the way to the best.

A trust region that begins with a step of one unit, as that of scipy does, and doubles it at most, takes a dozen rounds
to reach the first whole step where the residuals are thousands of kilometres. Levenberg and Marquardt begin with the
whole step, and shorten it where it leads up.
"""

from collections.abc import Callable

import numpy as np

_MOST_ROUNDS = 40
_LEAST_DAMPING = 1e-10
_GROWS = 10.0


def levenberg_marquardt(
    residuals: Callable[[np.ndarray], np.ndarray],
    slopes: Callable[[np.ndarray], np.ndarray],
    start: np.ndarray,
    tolerance: float = 1e-6,
    fine: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """The unknowns (N,) with the least sum of squared residuals near `start`, and their residuals (K,).

    Args:
        residuals: of unknowns, finite.
        slopes: their derivatives (K, N); as near as rounds are to be few.
        start: where to begin.
        tolerance: of the sum of squares, relative: where no step is foreseen to gain more, it is the least.
        fine: the same, as a sum of squares: what is not worth a round, as the slopes or the residuals err by as much.

    Each unknown is measured by the length of its column of slopes, so that units do not matter (Marquardt 1963).
    """
    x, here = start, residuals(start)
    cost, damping = float(here @ here), _LEAST_DAMPING
    for _ in range(_MOST_ROUNDS):
        matrix = slopes(x)
        scale = np.linalg.norm(matrix, axis=0)
        scale[scale == 0.0] = 1.0
        while True:
            scaled = _damped_step(matrix / scale, here, damping)
            foreseen = here + (matrix / scale) @ scaled
            if cost - float(foreseen @ foreseen) <= tolerance * cost + fine:
                return x, here
            there = residuals(x + scaled / scale)
            reached = float(there @ there)
            if reached < cost:
                break
            damping *= _GROWS
        x, here, cost = x + scaled / scale, there, reached
        damping = max(damping / _GROWS, _LEAST_DAMPING)
    return x, here


def _damped_step(matrix: np.ndarray, residuals: np.ndarray, damping: float) -> np.ndarray:
    """Solves (A'A + damping) step = -A'r, as least squares of a longer matrix, which keeps its digits."""
    count = matrix.shape[1]
    longer = np.vstack((matrix, np.sqrt(damping) * np.eye(count)))
    return np.linalg.lstsq(longer, -np.concatenate((residuals, np.zeros(count))), rcond=None)[0]
