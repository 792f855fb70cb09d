# SPDX-License-Identifier: Apache-2.0
"""Directions spread evenly over the sphere, weights of them, and what the weights come to."""

import math

from css_common.kernel import kernel
from css_common.vectors import Vec3, axes_across, dot, unit

# Golden angle [rad]: points turned by it from one circle to the next are spread evenly (Fibonacci lattice).
_GOLDEN = math.pi * (3.0 - math.sqrt(5.0))


@kernel
def direction(g: int, count: int) -> Vec3:
    """Direction `g` of `count`, a unit vector."""
    z = 1.0 - 2.0 * (g + 0.5) / count
    r, a = math.sqrt(1.0 - z * z), _GOLDEN * g
    return r * math.cos(a), r * math.sin(a), z


@kernel
def mean_direction(grid) -> tuple[Vec3, float]:
    """Mean of all directions by their weights, and the variance on the worst axis across it [rad^2].

    Args:
        grid: (G,) logarithms of the weights, brought to a largest of 0.
    """
    count = grid.shape[0]
    best = -math.inf
    for g in range(count):
        best = max(best, grid[g])
    total = x = y = z = 0.0
    for g in range(count):
        grid[g] -= best
        weight = math.exp(grid[g])
        d = direction(g, count)
        total += weight
        x += weight * d[0]
        y += weight * d[1]
        z += weight * d[2]
    mean = unit((x, y, z))
    first, second = axes_across(mean)
    aa = ab = bb = 0.0
    for g in range(count):
        weight = math.exp(grid[g]) / total
        d = direction(g, count)
        a, b = dot(d, first), dot(d, second)
        across = math.sqrt(a * a + b * b)
        if across > 0.0:
            angle = math.atan2(across, dot(d, mean)) / across
            a, b = a * angle, b * angle
            aa += weight * a * a
            ab += weight * a * b
            bb += weight * b * b
    return mean, 0.5 * (aa + bb) + math.sqrt(0.25 * (aa - bb) * (aa - bb) + ab * ab)
