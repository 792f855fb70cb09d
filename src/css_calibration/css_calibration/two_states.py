# SPDX-License-Identifier: Apache-2.0
"""Of all sequences of two states the likeliest, by what each instant says and how seldom one becomes the other."""

import numpy as np

from css_common.kernel import kernel, typed_call


def two_states(for_second: np.ndarray, change: float) -> np.ndarray:
    """(M,) 0 or 1 (Viterbi), the first one likelier by `change` to begin with.

    Args:
        for_second: (M,) logarithm of how much likelier the second state is, by each instant.
        change: -ln of the chance that the state changes at an instant.
    """
    state = np.empty(len(for_second), np.int64)
    _likeliest_states(np.ascontiguousarray(for_second), change, state, np.zeros((len(for_second), 2), np.int64))
    return state


@kernel
def _likeliest(for_second, change: float, state, came) -> None:
    healthy, failed = 0.0, -change
    for k in range(for_second.shape[0]):
        came[k, 0] = 0 if healthy >= failed - change else 1
        came[k, 1] = 1 if failed >= healthy - change else 0
        best_healthy = max(healthy, failed - change)
        best_failed = max(failed, healthy - change) + for_second[k]
        healthy, failed = best_healthy, best_failed
    now = 1 if failed > healthy else 0
    for k in range(for_second.shape[0] - 1, -1, -1):
        state[k] = now
        now = came[k, now]


_likeliest_states = typed_call(_likeliest)
