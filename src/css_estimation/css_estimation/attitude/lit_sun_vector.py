# SPDX-License-Identifier: Apache-2.0
"""Sun vector by least squares from the lit cells as a measurement of attitude (DiGregorio & Crassidis, "SMM").

s = (N^T N)^-1 N^T V of the lit rows alone: a dark row with an output of zero would bias it. Its covariance is
sigma^2 (N^T N)^-1, so along the eigenvectors of N^T N its components err independently. Where the lit normals do
not span space there is no Sun vector, and none is made up. The light of the Earth that was taken off the outputs errs
with attitude and with the Earth's brightness, in all cells together.
"""

import math
from typing import NamedTuple

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, add, cross, dot, row, scale
from css_estimation.attitude.direction_measurement import DirectionMeasurement, no_direction
from css_estimation.attitude.earth_on_cells import EarthOnCells
from css_estimation.sun.error_covariance import Block, Partials, no_block
from css_estimation.sun.least_squares import normal_equations
from css_estimation.symmetric import eigen

LEAST_RATIO = 1e-6
"""Smallest over largest eigenvalue of N^T N below which a direction is unknown."""


class LitSun(NamedTuple):
    """Least squares of the lit cells; `vector` has length 1 up to errors."""

    vector: Vec3  # of least norm where the normals do not span space
    rank: int  # directions that the lit normals span
    information: Vec3  # eigenvalues of N^T N, largest first: one over the variance for a cell variance of one
    axes: Mat3  # their eigenvectors as rows


@kernel
def lit_sun(cells, outputs, mask: int, top: int) -> LitSun:
    """Sun vector of the cells in `mask`, among them the brightest, `top`.

    Args:
        outputs: (N,) relative to the Sun at normal incidence.
    """
    equations = normal_equations(cells, False, outputs, mask, top)
    values, axes = eigen(equations.matrix)
    x = (0.0, 0.0, 0.0)
    rank = 0
    for k in range(3):
        if values[k] > LEAST_RATIO * values[0]:
            x = add(x, scale(dot(axes[k], equations.vector) / values[k], axes[k]))
            rank += 1
    return LitSun(scale(outputs[top], x), rank, values, axes)


@kernel
def sun_vector_measurement(
    sun: LitSun, cells, mask: int, predicted_b: Vec3, intensity: float, earth: EarthOnCells, variance: float
) -> DirectionMeasurement:
    """Sun vector against the unit vector `predicted_b`. No update below rank 3.

    Args:
        sun: of the cells in `mask`, whose outputs were relative to the Sun and without light of the Earth.
        intensity: of the Sun, 1 at 1 AU.
        earth: light of the Earth as it was taken off.
        variance: of a cell's output.
    """
    if sun.rank < 3:
        return no_direction()
    difference = (sun.vector[0] - predicted_b[0], sun.vector[1] - predicted_b[1], sun.vector[2] - predicted_b[2])
    root = (math.sqrt(sun.information[0]), math.sqrt(sun.information[1]), math.sqrt(sun.information[2]))
    return DirectionMeasurement(
        (
            _row(sun, cells, mask, 0, predicted_b, intensity, earth),
            _row(sun, cells, mask, 1, predicted_b, intensity, earth),
            _row(sun, cells, mask, 2, predicted_b, intensity, earth),
        ),
        (
            root[0] * dot(sun.axes[0], difference),
            root[1] * dot(sun.axes[1], difference),
            root[2] * dot(sun.axes[2], difference),
        ),
        variance,
        3,
    )


@kernel
def _row(sun: LitSun, cells, mask: int, k: int, predicted_b: Vec3, intensity: float, earth: EarthOnCells) -> Partials:
    """Derivatives of the component along the k-th eigenvector, scaled to the variance of one cell."""
    axis, root = sun.axes[k], math.sqrt(sun.information[k])
    attitude = scale(root, cross(axis, predicted_b))
    if not earth.counts:
        return Partials(attitude, no_block(), no_block())
    by_brightness = 0.0
    for i in range(earth.light.shape[0]):
        if mask >> i & 1 == 1:
            share = dot(axis, (cells[i].nx, cells[i].ny, cells[i].nz)) / (root * intensity)
            attitude = add(attitude, scale(share * earth.brightness, row(earth.slopes, i)))
            by_brightness += share * earth.light[i]
    return Partials(attitude, no_block(), Block(earth.at, earth.errors, (by_brightness, 0.0, 0.0)))
