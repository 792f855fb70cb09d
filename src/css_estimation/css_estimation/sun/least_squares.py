# SPDX-License-Identifier: Apache-2.0
"""Least-squares Sun heading: unbiased where the lit cells span space.

Outputs V = N x with the rows of N the normals of the cells above the gate, and x the Sun direction times a scale
common to all cells. Three or more cells that span space give x by least squares, weighted with the outputs as
dim cells err more by the light of the Earth (Basilisk's cssWlsEst), or evenly. Fewer cells, or normals in a plane
or nearly so, leave part of x unknown: the pseudo-inverse, whose weak directions the condition test drops, gives
the solution of least norm, x = N^T (N N^T)^-1 V for independent normals. That is the Sun projected on the span of
the normals, and the heading errs by the Sun's angle from it, on either side. The covariance says by how much, as far
as the light on the cells is that of the Sun (`left_open`).

Dark cells know about the unknown part (`use_dark_cells`): the Sun is where just the lit cells see it
(`sun_patterns`). Of that part of the sphere with mean m and covariance C, one lit cell leaves the mean. Lit cells
in a plane fix the direction p of the projection, which is h.s = 0 for the vector h across p in the plane, and the
best linear estimate with that is m - C h (h.m) / (h.C h). Scale stays without effect. A failed cell lies about
the dark, so the option is for cells that are known to work; outputs that no Sun explains get the least norm.

Over the sphere, for the dual pyramid of O'Keefe & Schaub 2013 with ideal cells, mean errors are 23.84 deg for
their weighted average, 21.34 deg for this, and 13.32 deg with the dark cells.

Modes: 0 no Sun; 1 normals along a line (one cell), 2 in a plane, 3 spanning space; 4 brightest cell below an
absolute gate; 5 and 6 as 1 and 2, with the dark cells used.
"""

from typing import NamedTuple

import numpy as np

from css_common.declared import builder, built, computed, given, made, part, table_of
from css_common.kernel import kernel
from css_common.schema import Values, choice, flag, real
from css_common.vectors import Vec3, add, cross, dot, norm, scale, subtract
from css_estimation.sun import sun_tracking
from css_estimation.sun.cell_layout import brightest, cell_layout, missing_cells
from css_estimation.sun.left_open import Span, second_moment, span_of, spread_along
from css_estimation.sun.lit_cells import CELL_SIGMA, Gate, lit_cells
from css_estimation.sun.snapshot import MODE_NO_SUN, Snapshot, SnapshotParameters, finish_snapshot
from css_estimation.sun.sun_algorithm import no_memory
from css_estimation.sun.sun_heading import NO_COVARIANCE, Aiding, Covariance, SunHeading
from css_estimation.sun.sun_patterns import NO_PATTERNS, find_pattern, sun_patterns
from css_estimation.sun.sun_tracking import TrackingState
from css_estimation.sun.sunline_filter import constrain
from css_estimation.symmetric import Symmetric, add_outer, congruence, eigen, product, row_major, scaled

MODE_LINE = 1
MODE_PLANE = 2
MODE_SPACE = 3
MODE_BELOW_GATE = 4
MODE_LINE_AND_DARK = 5
MODE_PLANE_AND_DARK = 6

# Relative to the brightest output. The projection of a Sun that its cell sees is never shorter than one: lit cells
# that cancel to less contradict each other.
_NO_DIRECTION = 0.1
# Beyond these a variance says no more, and must not overflow.
_LARGEST_SIGMA = 1e6
_LARGEST_VARIANCE = 4.0


_USE_DARK_CELLS = flag("use_dark_cells", False, "where cells do not span space, go by those that are dark")


def _patterns(values: Values) -> np.ndarray:
    return sun_patterns(cell_layout(values), built(Gate, values)) if values[_USE_DARK_CELLS] else NO_PATTERNS


class LeastSquaresParameters(NamedTuple):
    """All of the estimator."""

    weighted: bool = made(
        lambda word: word == "output",
        choice("weights", "output", ("output", "equal"), "weights of the cells: their outputs, or all the same"),
    )
    smallest_ratio: float = made(  # of eigenvalues of sum w n n^T: one over the square of the condition number
        lambda condition: condition**-2.0,
        real("largest_condition", 10.0, "-", "condition number beyond which a direction is unknown", low=3.0, high=1e3),
    )
    cell_sigma: float = given(CELL_SIGMA)
    patterns: np.ndarray = computed(_patterns, _USE_DARK_CELLS)  # (P,) of sun_patterns.PATTERN; empty: not used
    snapshot: SnapshotParameters = part(SnapshotParameters)


PARAMETERS = table_of(LeastSquaresParameters)
parameters = builder(LeastSquaresParameters)


class NormalEquations(NamedTuple):
    """M x = b of the lit cells, with outputs relative to the brightest."""

    matrix: Symmetric  # M = sum w n n^T
    squared: Symmetric  # sum w^2 n n^T
    vector: Vec3  # b = sum w V n


initial_memory = no_memory


def initial_state(p: LeastSquaresParameters) -> TrackingState:
    """No estimate yet."""
    return sun_tracking.initial_state()


@kernel
def normal_equations(cells, weighted: bool, voltages, mask: int, top: int) -> NormalEquations:
    """Normal equations of the cells in `mask`, among them the brightest, `top`."""
    m = m2 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    b = (0.0, 0.0, 0.0)
    for i in range(voltages.shape[0]):
        if mask >> i & 1:
            v = voltages[i] / voltages[top]
            w = v if weighted else 1.0
            n = (cells[i].nx, cells[i].ny, cells[i].nz)
            m = add_outer(m, w, n)
            m2 = add_outer(m2, w * w, n)
            b = add(b, scale(w * v, n))
    return NormalEquations(m, m2, b)


@kernel
def dark_solution(pattern, rank: int, across: Vec3, sun_b: Vec3) -> tuple[Vec3, Symmetric]:
    """Mean and covariance of the Sun's direction, of the `pattern` of lit cells and what their outputs tell.

    Args:
        rank: dimensions that the lit normals span, 1 or 2.
        across: unit normal of their plane, if they span one.
        sun_b: unit heading of least norm.
    """
    m = (pattern.x, pattern.y, pattern.z)
    c = (pattern.xx, pattern.xy, pattern.xz, pattern.yy, pattern.yz, pattern.zz)
    if rank == 1:
        return m, c
    h = cross(across, sun_b)
    ch = product(c, h)
    inverse = 1.0 / dot(h, ch)
    return subtract(m, scale(dot(h, m) * inverse, ch)), add_outer(c, -inverse, ch)


@kernel
def least_squares(p: LeastSquaresParameters, voltages, top: int) -> Snapshot:
    """Heading, covariance, cells used and mode of one cycle.

    Args:
        voltages: (N,) cell outputs [-]; values that are not finite count as dark.
        top: result of `brightest`.
    """
    cells = p.snapshot.layout.cells
    none = Snapshot((0.0, 0.0, 0.0), NO_COVARIANCE, 0, MODE_NO_SUN)
    lit, mask = lit_cells(p.snapshot.layout, p.snapshot.gate, voltages, top)
    if not lit:
        return none
    if mask == 0:
        normal_b, alone = (cells[top].nx, cells[top].ny, cells[top].nz), 1 << top
        moment = _left_open(p, span_of(cells, alone), scale(voltages[top], normal_b), alone, normal_b)
        return Snapshot(normal_b, moment, alone, MODE_BELOW_GATE)
    equations = normal_equations(cells, p.weighted, voltages, mask, top)
    values, vectors = eigen(equations.matrix)
    x = (0.0, 0.0, 0.0)
    inverse = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    rank = 0
    for k in range(3):
        if values[k] >= p.smallest_ratio * values[0]:
            x = add(x, scale(dot(vectors[k], equations.vector) / values[k], vectors[k]))
            inverse = add_outer(inverse, 1.0 / values[k], vectors[k])
            rank += 1
    length = norm(x)
    if length < _NO_DIRECTION:
        return none
    sun_b = scale(1.0 / length, x)
    if rank == 3:
        sigma = min(p.cell_sigma / voltages[top], _LARGEST_SIGMA) / length
        return Snapshot(sun_b, _covariance(sun_b, _sandwich(inverse, equations.squared, sigma)), mask, MODE_SPACE)
    found = find_pattern(p.patterns, mask)
    # a cell whose output is missing may be lit: it is not one of the dark
    if found >= 0 and missing_cells(voltages) == 0:
        mean, spread = dark_solution(p.patterns[found], rank, vectors[2], sun_b)
        # the outputs may contradict the pattern: then they decide
        if dot(mean, sun_b) > 0.0:
            sun_b = scale(1.0 / norm(mean), mean)
            mode = MODE_LINE_AND_DARK if rank == 1 else MODE_PLANE_AND_DARK
            return Snapshot(sun_b, _covariance(sun_b, spread), mask, mode)
    span = Span(rank, vectors, spread_along(cells, mask, vectors))
    return Snapshot(sun_b, _left_open(p, span, scale(voltages[top], x), mask, sun_b), mask, rank)


@kernel
def _left_open(p: LeastSquaresParameters, span: Span, projected: Vec3, mask: int, sun_b: Vec3) -> Covariance:
    """Covariance of a heading of least norm."""
    return _covariance(sun_b, second_moment(p.snapshot.layout, span, projected, mask, p.cell_sigma, sun_b))


@kernel
def _sandwich(inverse: Symmetric, squared: Symmetric, sigma: float) -> Symmetric:
    """Covariance of x for cells that err alike, whatever their weights: M^-1 (sum w^2 n n^T) M^-1 sigma^2."""
    a = inverse
    rows = ((a[0], a[1], a[2]), (a[1], a[3], a[4]), (a[2], a[4], a[5]))
    return scaled(congruence(rows, squared), sigma * sigma)


@kernel
def _covariance(sun_b: Vec3, p: Symmetric) -> Covariance:
    return row_major(constrain(sun_b, sun_b, p, _LARGEST_VARIANCE)[1])


@kernel
def step(
    p: LeastSquaresParameters,
    state: TrackingState,
    memory: None,
    dt: float,
    voltages,
    aiding: Aiding,
) -> tuple[TrackingState, SunHeading]:
    """One cycle; arguments in `css_estimation.sun.sun_algorithm`."""
    top = brightest(voltages)
    seen = least_squares(p, voltages, top)
    return finish_snapshot(p.snapshot, state, dt, voltages, top, aiding, seen)
