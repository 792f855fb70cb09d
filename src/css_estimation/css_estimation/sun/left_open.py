# SPDX-License-Identifier: Apache-2.0
"""What the outputs of lit cells leave open of the Sun's direction.

Normals that do not span space show the Sun's projection on their span, and by its length how far off the span the Sun
is, but not on which side: its mirror image in the span gives the same outputs. Two cells, or any number in a plane,
have two Suns; one cell, or several that look alike, have a ring of them.
"""

from typing import NamedTuple

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, add, axes_across, cross, dot, multiply, norm, scale, subtract, unit
from css_estimation.sun.cell_layout import READABLE, CellLayout, cosine_on, half_view_of, missing_cells
from css_estimation.symmetric import Symmetric, add_outer, eigen, trace
from css_sensors.cells import IN_PLANE

# Eigenvalues of sum n n^T, relative to the largest. Cells that show a direction by less than a tenth of what they show
# of another leave it open (as `largest_condition` of the least squares).
_OPEN = 1e-2
_NO_LENGTH = 1e-6


class Span(NamedTuple):
    """Of some normals."""

    rank: int  # dimensions, 0 to 3
    axes: Mat3  # orthonormal rows, of which the first `rank` span it
    spread: Vec3  # sum (n . axis)^2 along each


@kernel
def _outer_sum(cells, mask: int) -> Symmetric:
    """Sum of n n^T over the cells in `mask`."""
    m = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for i in range(cells.shape[0]):
        if mask >> i & 1:
            m = add_outer(m, 1.0, (cells[i].nx, cells[i].ny, cells[i].nz))
    return m


@kernel
def _span_of_one(n: Vec3) -> Span:
    return Span(1, (n, *axes_across(n)), (1.0, 0.0, 0.0))


@kernel
def _span_of_two(a: Vec3, b: Vec3) -> Span:
    """Of unit vectors: n n^T has their sum and their difference for eigenvectors."""
    if dot(a, b) < 0.0:
        b = scale(-1.0, b)
    cosine = min(dot(a, b), 1.0)
    first, off = unit(add(a, b)), subtract(a, b)
    second, third = axes_across(first)
    if norm(off) > _NO_LENGTH:
        second = unit(off)
        third = cross(first, second)
    rank = 2 if 1.0 - cosine >= _OPEN * (1.0 + cosine) else 1
    return Span(rank, (first, second, third), (1.0 + cosine, 1.0 - cosine, 0.0))


@kernel
def span_of(cells, mask: int) -> Span:
    """Span of the normals of the cells in `mask`.

    One or two cells, which most often leave something open, have it without the search for eigenvectors.

    Args:
        cells: (N,) with the fields nx, ny, nz.
    """
    count = 0
    last = before = (0.0, 0.0, 0.0)
    for i in range(cells.shape[0]):
        if mask >> i & 1:
            last, before = (cells[i].nx, cells[i].ny, cells[i].nz), last
            count += 1
    if count == 1:
        return _span_of_one(last)
    if count == 2:
        return _span_of_two(before, last)
    spread, axes = eigen(_outer_sum(cells, mask))
    rank = 0
    for k in range(3):
        if spread[k] > 0.0 and spread[k] >= _OPEN * spread[0]:
            rank += 1
    return Span(rank, axes, spread)


@kernel
def spread_along(cells, mask: int, axes: Mat3) -> Vec3:
    """Sum of the squares of the normals' components along three axes."""
    x = y = z = 0.0
    for i in range(cells.shape[0]):
        if mask >> i & 1:
            n = (cells[i].nx, cells[i].ny, cells[i].nz)
            along = multiply(axes, n)
            x, y, z = x + along[0] * along[0], y + along[1] * along[1], z + along[2] * along[2]
    return x, y, z


@kernel
def surely_spans_space(cells, mask: int) -> bool:
    """Whether the normals of the cells in `mask` span space, by a bound that is cheap: false says nothing.

    Of the eigenvalues a >= b >= c is a^2 b <= 4/27 (a + b)^3, so that c / a >= 27/4 det / trace^3.
    """
    m = _outer_sum(cells, mask)
    determinant = m[0] * (m[3] * m[5] - m[4] * m[4]) - m[1] * (m[1] * m[5] - m[4] * m[2])
    determinant += m[2] * (m[1] * m[4] - m[3] * m[2])
    total = trace(m)
    return 6.75 * determinant > _OPEN * total * total * total


@kernel
def spans_space(cells, mask: int) -> bool:
    """Whether the normals of the cells in `mask` span space."""
    return surely_spans_space(cells, mask) or span_of(cells, mask).rank == 3


@kernel
def tell_one_sun(cells, voltages) -> bool:
    """Whether the normals of all cells that have a reading, dark ones too, span space: else each Sun has a twin.

    Args:
        cells: (N,) with the fields nx, ny, nz.
        voltages: (N,) outputs, NaN where there is none.
    """
    return spans_space(cells, ~missing_cells(voltages))


@kernel
def mirrored(span: Span, v: Vec3) -> Vec3:
    """Mirror image of a vector in a span: what gives the cells of that span the same outputs."""
    for k in range(3):
        if k >= span.rank:
            v = subtract(v, scale(2.0 * dot(span.axes[k], v), span.axes[k]))
    return v


@kernel
def projection(layout: CellLayout, span: Span, voltages, mask: int) -> Vec3:
    """The Sun vector on the span of the cells in `mask`, by least squares; its length is the light times a cosine."""
    x = (0.0, 0.0, 0.0)
    for i in range(voltages.shape[0]):
        # a NaN compares false
        if mask >> i & 1 and abs(voltages[i]) < READABLE:
            cell = layout.cells[i]
            x = add(x, scale(voltages[i], (cell.nx, cell.ny, cell.nz)))
    found = (0.0, 0.0, 0.0)
    for k in range(3):
        if k < span.rank:
            found = add(found, scale(dot(span.axes[k], x) / span.spread[k], span.axes[k]))
    return found


@kernel
def second_moment(
    layout: CellLayout, span: Span, projected: Vec3, mask: int, cell_sigma: float, heading_b: Vec3
) -> Symmetric:
    """Second moment, about a heading, of the directions that the outputs leave: its error, bias included.

    The length of the projection is the cosine of the Sun's angle to the span, less the cells' error to the bad side; it
    is no smaller than the views of the cells allow. On either side of the span the Sun is as likely.

    Args:
        projected: result of `projection`.
        heading_b: unit vector.
    """
    length = norm(projected)
    direction = scale(1.0 / length, projected) if length > _NO_LENGTH else heading_b
    cosine = 1.0
    if span.rank < 3:
        least = 0.0
        for i in range(layout.cells.shape[0]):
            along, half = cosine_on(layout, i, direction), half_view_of(layout, i)
            # a view of 180 deg bounds nothing, whatever rounding makes of its cosine
            if mask >> i & 1 and half > IN_PLANE and along > half:
                least = max(least, half / along)
        cosine = min(1.0, max(min(length, 1.0) - cell_sigma, least))
    off = subtract(scale(cosine, direction), heading_b)
    moment = add_outer((0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 1.0, off)
    error = cell_sigma / max(length, cell_sigma)
    for k in range(3):
        if k < span.rank:
            moment = add_outer(moment, error * error / span.spread[k], span.axes[k])
        else:
            moment = add_outer(moment, (1.0 - cosine * cosine) / (3 - span.rank), span.axes[k])
    return moment
