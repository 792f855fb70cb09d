# SPDX-License-Identifier: Apache-2.0
"""A random walk that can be read at any step without its history.

Levy's construction of Brownian motion: the value at the end of the horizon is drawn first, then halves are filled
in by the Brownian bridge, each midpoint with the draw of its own number. The value at a step depends on the 32
midpoints above it and on nothing else, so a node restarted half-way walks on along the same path.
"""

import math

from css_common.kernel import kernel
from css_common.random_streams import RandomKey, normal4
from css_common.vectors import Vec3

HORIZON = 1 << 32
"""Steps after which the walk stays where it is."""


@kernel
def random_walk(key: RandomKey, stream: int, index: int, step: int) -> Vec3:
    """Three independent walks at `step`, zero at step 0, whose increments per step are standard normal.

    The numbers (stream, 0 to 2**32 - 1, index) belong to the walk and to no other use.
    """
    step = min(max(step, 0), HORIZON)
    low, high = 0, HORIZON
    n = normal4(key, stream, 0, index)
    root = math.sqrt(float(HORIZON))
    low_x, low_y, low_z = 0.0, 0.0, 0.0
    high_x, high_y, high_z = root * n[0], root * n[1], root * n[2]
    while high - low > 1:
        middle = (low + high) // 2
        n = normal4(key, stream, middle, index)
        # the bridge over a length T has variance T/4 in the middle
        spread = 0.5 * math.sqrt(float(high - low))
        x = 0.5 * (low_x + high_x) + spread * n[0]
        y = 0.5 * (low_y + high_y) + spread * n[1]
        z = 0.5 * (low_z + high_z) + spread * n[2]
        if step >= middle:
            low, low_x, low_y, low_z = middle, x, y, z
        else:
            high, high_x, high_y, high_z = middle, x, y, z
    if step == HORIZON:
        return (high_x, high_y, high_z)
    return (low_x, low_y, low_z)
