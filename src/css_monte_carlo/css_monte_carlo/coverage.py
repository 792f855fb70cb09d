# SPDX-License-Identifier: Apache-2.0
"""How well a layout of coarse sun sensor cells sees the Sun (O'Keefe & Schaub 2013, Figs. 1b and 2).

The Sun is put into every direction of a grid. The cells answer through the signal chain that flies, without
noise, degradation and faults, and the weighted average that flies makes a heading of their outputs.

The pole of the grid is the normal of the solar arrays, because what counts is how good the heading is near
where the spacecraft wants to point. Directions are cell centres; everything is weighted by solid angle.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from css_analysis.body_axes import axes_about
from css_common.case_faults import NEVER
from css_common.component import Component
from css_common.kernel import outer_kernel
from css_common.mission import Mission
from css_common.mission_node import Node
from css_common.random_streams import RandomKey, random_key
from css_common.schema import Values
from css_common.vectors import Mat3, Vec3, angle_between, mat3, multiply_transposed
from css_estimation.nodes.wavg import Wavg
from css_estimation.sun import wavg
from css_estimation.sun.cell_layout import CellLayout, brightest
from css_estimation.sun.lit_cells import Gate
from css_estimation.sun.snapshot import MODE_NO_SUN
from css_sim import sun_cells
from css_sim.cell_errors import nominal_cells
from css_sim.cell_screen import cell_sides
from css_sim.fault_effects import CELL, DEAD, FAULT
from css_sim.nodes.css_array import CssArray
from css_sim.sun_cells import SunCells, sample

POLAR_CELLS, AZIMUTH_CELLS = 720, 1440


class Grid(NamedTuple):
    """Directions in rings about the array normal."""

    polar: np.ndarray  # (P,) [rad] angle from the array normal, centres of the grid's cells
    azimuth: np.ndarray  # (A,) [rad] about the array normal, from `axes[0]` towards `axes[1]`
    axes: Mat3  # the grid's axes in b, the third is the array normal
    ring_weight: np.ndarray  # (P,) share of one ring in the sphere; they add to 1


class CellMap(NamedTuple):
    """What the cells make of the Sun in each direction of a grid."""

    seen_by: np.ndarray  # (P, A) int64, number of cells that the Sun lights
    wavg_error: np.ndarray  # (P, A) [rad] angle of the weighted average to the Sun; NaN: no estimate


def grid_about(array_normal_b: Vec3, polar_cells: int = POLAR_CELLS, azimuth_cells: int = AZIMUTH_CELLS) -> Grid:
    """A grid about a unit vector in b; azimuth zero is towards the body's x axis (y, when x is the normal)."""
    axes = axes_about(array_normal_b)
    polar = (np.arange(polar_cells) + 0.5) * (math.pi / polar_cells)
    azimuth = (np.arange(azimuth_cells) + 0.5) * (2.0 * math.pi / azimuth_cells)
    weight = np.sin(polar)
    return Grid(polar, azimuth, mat3(axes), weight / weight.sum())


def grid_of(mission: Mission) -> Grid:
    """The full grid about the array normal of a mission."""
    x, y, z = mission.values.spacecraft.array_normal
    return grid_about((x, y, z))


class Layout(NamedTuple):
    """The cells of a spacecraft as they are, and as the weighted average knows them."""

    chain: SunCells
    cells: np.ndarray  # (N,) of css_sim.cell_errors.CELL
    known: CellLayout
    gate: Gate


def layout_of(cell_values: Values, average_values: Values) -> Layout:
    """The layout without errors, noise, degradation, faults and limits of output.

    Args:
        cell_values: of a `css_sim/css_array` node.
        average_values: of a `css_estimation/wavg` node.
    """
    chain = sun_cells.parameters(cell_values)._replace(
        degradation=0.0,
        noise=0.0,
        dropout=0.0,
        output_low=0.0,
        output_high=math.inf,
        levels=0.0,
    )
    cells = nominal_cells(cell_values.cells.normals, cell_sides(cell_values))
    average = wavg.parameters(average_values).snapshot
    return Layout(chain, cells, average.layout, average.gate)


def layout_of_mission(mission: Mission) -> Layout:
    """The layout of a mission; nodes that its graph does not have are taken with the mission's shared values."""
    return layout_of(_node(mission, CssArray, "css_array").values, _node(mission, Wavg, "wavg").values)


def _node(mission: Mission, component: type[Component], name: str) -> Node:
    of_kind = (node for node in mission.nodes if node.component is component)
    return next(of_kind, None) or mission.node_of(component, name)


def map_cells(layout: Layout, grid: Grid, warp: bool = False, dead: Sequence[int] = ()) -> CellMap:
    """The map of a layout, for cells with an ideal cosine or with the flattened response of Eq. 16 (`warp`).

    Args:
        dead: cells that give nothing.
    """
    faults = np.zeros(len(dead), FAULT)
    faults["sort"], faults["kind"], faults["unit"], faults["end_step"] = CELL, DEAD, list(dead), NEVER
    shape = (len(grid.polar), len(grid.azimuth))
    result = CellMap(np.zeros(shape, dtype=np.int64), np.zeros(shape))
    _map(layout._replace(chain=layout.chain._replace(warp=warp)), faults, random_key(0, 0), grid, *result)
    return result


@outer_kernel
def _map(layout: Layout, faults, key: RandomKey, grid: Grid, seen_by_out, error_out) -> None:
    count = layout.cells.shape[0]
    albedo = np.zeros(count)
    voltages = np.zeros(count)
    for i in range(grid.polar.shape[0]):
        across, along = math.sin(grid.polar[i]), math.cos(grid.polar[i])
        for j in range(grid.azimuth.shape[0]):
            at = (across * math.cos(grid.azimuth[j]), across * math.sin(grid.azimuth[j]), along)
            sun_b = multiply_transposed(grid.axes, at)
            sample(layout.chain, layout.cells, faults, key, 0, sun_b, 1.0, albedo, voltages)
            for k in range(count):
                if voltages[k] > 0.0:
                    seen_by_out[i, j] += 1
            top = brightest(voltages)
            estimate_b, _, mode = wavg.weighted_average(layout.known, layout.gate, voltages, top)
            error_out[i, j] = math.nan if mode == MODE_NO_SUN else angle_between(estimate_b, sun_b)
