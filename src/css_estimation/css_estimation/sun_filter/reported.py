# SPDX-License-Identifier: Apache-2.0
"""The heading as the Sun filter reports it, with its error: that of all turns it follows, and of an unknown Earth.

The filter takes the light of an unknown Earth for noise and averages it; it lasts, and what it does to the heading
remains. An error e of the outputs of cells with the normals n_i moves the Sun s most to where they show it least,

    e^2 (M + e^2 / theta^2)^-1,    M = k sum g_i g_i^T,    g_i = n_i - (n_i.s) s,

on the plane across the Sun line. The light is alike on cells that look alike, so that many of them average nothing:
k <= 1 keeps the mean of M on the two axes at 1 at most. A cell that faces the Sun has no slope g, but a curvature:
beyond theta its output shows the error all the same, 1 - cos(theta) being the light of the Earth.
"""

import math

from css_common.kernel import kernel
from css_common.matrices import skew
from css_common.vectors import (
    Vec3,
    add,
    angle_between,
    dot,
    matmul,
    multiply,
    norm,
    scale,
    subtract,
    transpose,
    unit,
)
from css_estimation.sun.left_open import mirrored, span_of, surely_spans_space
from css_estimation.sun.sun_heading import Covariance
from css_estimation.sun_filter.cell_model import view_of
from css_estimation.sun_filter.memory import DEAD, HYPOTHESES, SunFilterMemory, attitude_block, dcm_of
from css_estimation.sun_filter.options import SunFilterParameters
from css_estimation.symmetric import Symmetric, add_outer, isotropic, product, row_major, scaled, trace

_NO_DIRECTION = 1e-6

LARGEST = 4.0
"""Reported variance [rad2] of a heading of which nothing is known."""


@kernel
def across(sun: Vec3, variance: float) -> Covariance:
    """Equal variance on both axes across the Sun line, row-major."""
    x, y, z = sun
    return (
        variance * (1.0 - x * x), -variance * x * y, -variance * x * z,
        -variance * x * y, variance * (1.0 - y * y), -variance * y * z,
        -variance * x * z, -variance * y * z, variance * (1.0 - z * z),
    )  # fmt: skip


@kernel
def by_unknown_earth(p: SunFilterParameters, sun_b: Vec3, used: int) -> Covariance:
    """What the lasting light of an Earth that is not predicted does to the heading, row-major.

    Args:
        used: mask of the cells that the heading rests on; 0 in the dark, when it is those that would see the Sun.
    """
    e2 = p.earth.unknown_heading
    if e2 == 0.0:
        return across(sun_b, 0.0)
    slopes, seeing = isotropic(0.0), 0
    for i in range(p.cells.shape[0]):
        cosine, seen, _ = view_of(p, i, sun_b, 0.0)
        if seen and cosine > 0.0 and (used == 0 or used >> i & 1):
            cell = p.cells[i]
            seeing |= 1 << i
            slopes = add_outer(slopes, 1.0, subtract((cell.nx, cell.ny, cell.nz), scale(cosine, sun_b)))
    alike = max(1.0, 0.5 * trace(slopes))
    slopes = scaled(slopes, 1.0 / alike)
    least = e2 / (2.0 * p.earth.unknown) if p.earth.unknown > 0.0 else 0.0
    xx, xy, xz, yy, yz, zz = slopes
    total = trace(slopes)
    # of a matrix M on a plane: M^-1 = (trace(M) - M) / det(M)
    determinant = (
        0.5 * (total * total - xx * xx - yy * yy - zz * zz) - xy * xy - xz * xz - yz * yz + least * (total + least)
    )
    if not determinant > 0.0:
        return across(sun_b, LARGEST)
    k, rest = e2 / determinant, across(sun_b, total + least)
    tangent = (
        k * (rest[0] - xx), k * (rest[1] - xy), k * (rest[2] - xz), k * (rest[4] - yy), k * (rest[5] - yz),
        k * (rest[8] - zz),
    )  # fmt: skip
    return row_major(_to_the_span(p, sun_b, seeing, alike * e2, tangent))


@kernel
def _to_the_span(p: SunFilterParameters, sun_b: Vec3, seeing: int, e2: float, tangent: Symmetric) -> Symmetric:
    """Covariance across the Sun line with the error on the way to the span of the cells, if they do not span space.

    In the span their outputs are largest, and on the way there they have ever less of a slope: light that lasts makes
    more of an error to that side than the slope at the heading tells. Taken is that of the chord.

    Args:
        seeing: mask of the cells.
        e2: variance of the light on all cells together [-].
        tangent: covariance by the slopes.
    """
    if seeing == 0 or surely_spans_space(p.cells, seeing):
        return tangent
    span = span_of(p.cells, seeing)
    top_b = add(sun_b, mirrored(span, sun_b))
    if span.rank == 3 or norm(top_b) < _NO_DIRECTION:
        return tangent
    top_b = unit(top_b)
    way = subtract(top_b, scale(dot(top_b, sun_b), sun_b))
    length, angle = norm(way), angle_between(top_b, sun_b)
    if length < _NO_DIRECTION:
        return tangent
    change = 0.0
    for i in range(p.cells.shape[0]):
        if seeing >> i & 1:
            cell = p.cells[i]
            change += dot((cell.nx, cell.ny, cell.nz), subtract(top_b, sun_b)) ** 2
    direction = scale(1.0 / length, way)
    lacking = angle * angle / max(1.0, change / e2) - dot(direction, product(tangent, direction))
    return add_outer(tangent, max(0.0, lacking), direction)


@kernel
def heading(
    p: SunFilterParameters, m: SunFilterMemory, sun_n: Vec3, earth_known: bool, used: int
) -> tuple[Vec3, Covariance]:
    """Direction to the Sun in b and its covariance, row-major: of all hypotheses that are followed, by their weights.

    Where they disagree about the Sun the disagreement is part of the covariance.

    Args:
        used: mask of the cells that this cycle rests on.
    """
    total, sun_b = 0.0, (0.0, 0.0, 0.0)
    for k in range(HYPOTHESES):
        if m.weights[k] > DEAD:
            weight = math.exp(m.weights[k])
            total += weight
            sun_b = add(sun_b, scale(weight, multiply(dcm_of(m.estimates[k]), sun_n)))
    sun_b = unit(sun_b)
    xx = yy = zz = xy = xz = yz = 0.0
    for k in range(HYPOTHESES):
        if not m.weights[k] > DEAD:
            continue
        weight = math.exp(m.weights[k]) / total
        # ds_b = dcm_bn (s x theta)
        dcm_bn = dcm_of(m.estimates[k])
        turn = matmul(dcm_bn, skew(sun_n))
        c = matmul(matmul(turn, attitude_block(m.covariances[k])), transpose(turn))
        off = subtract(multiply(dcm_bn, sun_n), sun_b)
        xx += weight * (c[0][0] + off[0] * off[0])
        yy += weight * (c[1][1] + off[1] * off[1])
        zz += weight * (c[2][2] + off[2] * off[2])
        xy += weight * (0.5 * (c[0][1] + c[1][0]) + off[0] * off[1])
        xz += weight * (0.5 * (c[0][2] + c[2][0]) + off[0] * off[2])
        yz += weight * (0.5 * (c[1][2] + c[2][1]) + off[1] * off[2])
    # what is beyond a bound is cut as a whole, so that it stays a covariance
    cut = min(1.0, LARGEST / max(xx, yy, zz, LARGEST))
    systematic = across(sun_b, 0.0) if earth_known else by_unknown_earth(p, sun_b, used)
    return sun_b, (
        cut * xx + systematic[0], cut * xy + systematic[1], cut * xz + systematic[2],
        cut * xy + systematic[1], cut * yy + systematic[4], cut * yz + systematic[5],
        cut * xz + systematic[2], cut * yz + systematic[5], cut * zz + systematic[8],
    )  # fmt: skip


@kernel
def mean_variance(covariance: Covariance) -> float:
    """Mean variance of the two axes across the Sun line."""
    return 0.5 * (covariance[0] + covariance[4] + covariance[8])
