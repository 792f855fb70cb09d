# SPDX-License-Identifier: Apache-2.0
"""Weighted-average Sun heading (O'Keefe & Schaub 2013, Eq. 2).

The sum runs over the cells that see the Sun, and the gate of `lit_cells` decides which these are. While it is
relative, a scale common to all cells has no effect: the method's main virtue.

Where one cell alone sees the Sun its output is the cosine of the heading's error, the measure that the paper speaks
of: the Sun is that far from the normal, on any side. The covariance says so, with the cell's own error to the bad side.
Several cells tell more (`left_open`): those in a plane how far the Sun is from that plane, on either side, and those
that span space where it is, from which the average then errs by its bias.

Modes: 0 no Sun, 1 average of several cells, 2 a single cell (the error can reach its half view), 3
brightest cell below an absolute gate.
"""

from typing import NamedTuple

from css_common.declared import builder, given, part, table_of
from css_common.kernel import kernel
from css_common.vectors import Vec3, norm, scale
from css_estimation.sun import sun_tracking
from css_estimation.sun.cell_layout import CellLayout, brightest, half_view_of
from css_estimation.sun.left_open import projection, second_moment, span_of
from css_estimation.sun.lit_cells import CELL_SIGMA, Gate, lit_cells
from css_estimation.sun.snapshot import MODE_NO_SUN, Snapshot, SnapshotParameters, finish_snapshot
from css_estimation.sun.sun_algorithm import no_memory
from css_estimation.sun.sun_heading import NO_COVARIANCE, Aiding, Covariance, SunHeading
from css_estimation.sun.sun_tracking import TrackingState
from css_estimation.sun.sunline_filter import constrain
from css_estimation.symmetric import isotropic, row_major

MODE_AVERAGE = 1
MODE_SINGLE_CELL = 2
MODE_BELOW_GATE = 3

_LARGEST_VARIANCE = 4.0
# Normals that cancel to less than this leave no direction.
_NO_DIRECTION = 1e-6


class WavgParameters(NamedTuple):
    """All of the estimator."""

    cell_sigma: float = given(CELL_SIGMA)
    snapshot: SnapshotParameters = part(SnapshotParameters)


PARAMETERS = table_of(WavgParameters)
parameters = builder(WavgParameters)


initial_memory = no_memory


def initial_state(p: WavgParameters) -> TrackingState:
    """No estimate yet."""
    return sun_tracking.initial_state()


@kernel
def weighted_average(layout: CellLayout, gate: Gate, voltages, top: int) -> tuple[Vec3, int, int]:
    """Sun heading (unit, in b), mask of the cells it uses, and mode; heading zero and mode 0 without a Sun.

    Args:
        voltages: (N,) cell outputs [-]; values that are not finite count as dark.
        top: result of `brightest`.
    """
    cells = layout.cells
    lit, mask = lit_cells(layout, gate, voltages, top)
    if not lit:
        return (0.0, 0.0, 0.0), 0, MODE_NO_SUN
    if mask == 0:
        return (cells[top].nx, cells[top].ny, cells[top].nz), 1 << top, MODE_BELOW_GATE
    x = y = z = 0.0
    for i in range(voltages.shape[0]):
        if mask >> i & 1:
            x += voltages[i] * cells[i].nx
            y += voltages[i] * cells[i].ny
            z += voltages[i] * cells[i].nz
    length = norm((x, y, z))
    if length < _NO_DIRECTION:
        return (0.0, 0.0, 0.0), 0, MODE_NO_SUN
    single = mask & (mask - 1) == 0
    return scale(1.0 / length, (x, y, z)), mask, MODE_SINGLE_CELL if single else MODE_AVERAGE


@kernel
def single_cell_covariance(layout: CellLayout, i: int, output: float, cell_sigma: float) -> Covariance:
    """Covariance of a heading along the normal of cell `i`, which alone sees the Sun and reads cos(error).

    On average over all sides each axis across the normal has half of sin^2.
    """
    cell = layout.cells[i]
    normal_b = (cell.nx, cell.ny, cell.nz)
    cosine = max(min(output, 1.0) - cell_sigma, half_view_of(layout, i), 0.0)
    variance = 0.5 * (1.0 - cosine * cosine)
    return row_major(constrain(normal_b, normal_b, isotropic(variance), _LARGEST_VARIANCE)[1])


@kernel
def average_covariance(layout: CellLayout, voltages, mask: int, cell_sigma: float, sun_b: Vec3) -> Covariance:
    """Covariance of the average of several cells: what their outputs leave of the Sun's direction, about it."""
    span = span_of(layout.cells, mask)
    projected = projection(layout, span, voltages, mask)
    moment = second_moment(layout, span, projected, mask, cell_sigma, sun_b)
    return row_major(constrain(sun_b, sun_b, moment, _LARGEST_VARIANCE)[1])


@kernel
def step(
    p: WavgParameters,
    state: TrackingState,
    memory: None,
    dt: float,
    voltages,
    aiding: Aiding,
) -> tuple[TrackingState, SunHeading]:
    """One cycle; arguments in `css_estimation.sun.sun_algorithm`."""
    top = brightest(voltages)
    sun_b, lit_mask, mode = weighted_average(p.snapshot.layout, p.snapshot.gate, voltages, top)
    covariance = NO_COVARIANCE
    if mode in (MODE_SINGLE_CELL, MODE_BELOW_GATE):
        covariance = single_cell_covariance(p.snapshot.layout, top, voltages[top], p.cell_sigma)
    elif mode == MODE_AVERAGE:
        covariance = average_covariance(p.snapshot.layout, voltages, lit_mask, p.cell_sigma, sun_b)
    seen = Snapshot(sun_b, covariance, lit_mask, mode)
    return finish_snapshot(p.snapshot, state, dt, voltages, top, aiding, seen)
