# SPDX-License-Identifier: Apache-2.0
"""Outputs in order of time, made such that their errors are white and of unit variance.

Of the error of an output one part is its own; one all cells of an instant have in common, as a loss of light; and one
stays with its cell while that looks at the same clouds, as a Gauss-Markov process of unit variance. A Kalman filter of
these parts predicts each output from those before it; what it did not foresee, over its standard deviation, is white
(Kailath 1968). The filter is linear with gains that do not depend on the outputs, so derivatives go through it the same
way, and a sum of squares of what comes out is the weighted least squares with the whole covariance of the errors.
"""

import math
from dataclasses import dataclass

import numpy as np

from css_common.kernel import kernel, typed_call


@dataclass
class Errors:
    """Of K outputs, in order of time.

    Attributes:
        instant: (K,) number of the instant of each.
        cell: (K,) which cell it is, of N.
        kept: (M,) share of the clouds on a cell that is left from the instant before, 0 to 1.
        own: (K,) variance that no other output has a part in.
        common: (K,) slope by the error that cells of an instant have in common, 1 sigma.
        cloudy: (K,) slope by the clouds of its cell, 1 sigma.
    """

    instant: np.ndarray
    cell: np.ndarray
    kept: np.ndarray
    own: np.ndarray
    common: np.ndarray
    cloudy: np.ndarray

    def whitened(self, values: np.ndarray) -> np.ndarray:
        """Residuals or derivatives (K, C) of the outputs as they are once errors are white and of unit variance."""
        out = np.array(values, dtype=np.float64, order="C")
        cells = int(self.cell.max(initial=-1)) + 1
        _whiten(
            self.instant, self.cell, self.kept, self.own, self.common, self.cloudy,
            np.eye(cells + 1), np.zeros((cells + 1, out.shape[1])), np.zeros(cells + 1), out,
        )  # fmt: skip
        return out


@kernel
def whiten(instant, cell, kept, own, common, cloudy, covariance, states, gain, values) -> None:
    """Whitens values (K, C) in place.

    Args:
        instant, cell, kept, own, common, cloudy: of `Errors`.
        covariance: (N + 1, N + 1) identity, written: of the clouds of each cell, and last of what is in common.
        states: (N + 1, C) zeros, written.
        gain: (N + 1,) room.
        values: (K, C) written.
    """
    last = covariance.shape[0] - 1
    columns = values.shape[1]
    now = instant[0] if instant.shape[0] > 0 else 0
    for r in range(instant.shape[0]):
        if instant[r] != now:
            share = 1.0
            for k in range(now + 1, instant[r] + 1):
                share *= kept[k]
            now = instant[r]
            for i in range(last):
                for j in range(last):
                    covariance[i, j] *= share * share
                covariance[i, i] += 1.0 - share * share
                covariance[i, last] = 0.0
                covariance[last, i] = 0.0
                for c in range(columns):
                    states[i, c] *= share
            covariance[last, last] = 1.0
            for c in range(columns):
                states[last, c] = 0.0
        i, by_cloud, by_common = cell[r], cloudy[r], common[r]
        for j in range(last + 1):
            gain[j] = by_cloud * covariance[j, i] + by_common * covariance[j, last]
        variance = own[r] + by_cloud * gain[i] + by_common * gain[last]
        for c in range(columns):
            new = values[r, c] - by_cloud * states[i, c] - by_common * states[last, c]
            for j in range(last + 1):
                states[j, c] += gain[j] / variance * new
            values[r, c] = new / math.sqrt(variance)
        for j in range(last + 1):
            for k in range(last + 1):
                covariance[j, k] -= gain[j] * gain[k] / variance


_whiten = typed_call(whiten)
