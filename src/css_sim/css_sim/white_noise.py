# SPDX-License-Identifier: Apache-2.0
"""White noise on the readings of a row of alike sensors."""

from css_common.kernel import kernel
from css_common.random_streams import RandomKey, normal4


@kernel
def add_noise(sigma: float, key: RandomKey, stream: int, step: int, readings) -> None:
    """Adds to each of the readings (N,) a draw of its own of standard deviation `sigma`."""
    n = readings.shape[0]
    for block in range((n + 3) // 4):
        draws = normal4(key, stream, step, block)
        first = 4 * block
        for j in range(min(4, n - first)):
            readings[first + j] += sigma * draws[j]
