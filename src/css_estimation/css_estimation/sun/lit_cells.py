# SPDX-License-Identifier: Apache-2.0
"""Which cells see the Sun, judged by their outputs.

Light reflected by the Earth gives a cell up to a quarter of the direct Sun (half of it on polar orbits): without
a gate such cells drag a heading by tens of degrees. A gate relative to the brightest cell leaves a scale that is
common to all cells without effect; an absolute gate does not.

A cell above the gate sees the Sun. That no other does is true of cells whose field of view ends before they read so
little: half a view of 60 deg leaves 0.5 of the normal Sun, one of 90 deg leaves nothing. Between the gate and what the
field of view leaves of the Sun, a cell counts unless one that is brighter looks at another part of the sky: two cells
whose views have nothing in common cannot both see the Sun, and the dimmer of them sees the Earth.
"""

import math
from typing import NamedTuple

from css_common.declared import computed, given, made
from css_common.kernel import kernel
from css_common.schema import Values, choice, flag, real
from css_estimation.sun.cell_layout import READABLE, CellLayout, share_view
from css_sensors.cells import half_view_cosine

CELL_SIGMA = real(
    "cell_sigma", 0.1, "-", "cell error, all causes, 1 sigma", low=0.0, open_low=True, high=10.0, tunable=True
)
"""Parameter of estimators whose covariance follows from the cells' errors."""


# A cell at the edge of its view reads the cosine of half the view, less what warp and losses take of it and what the
# Earth adds to the brightest one.
_AT_THE_EDGE = 0.9
# Of the gate: below it a cell with a view of 120 deg or less, which ends there, sees the Earth alone.
_ENDS_AT = 0.45

DIM_CELLS = flag(
    "dim_cells", True, "cells with views wider than 120 deg see the Sun below the gate too, if views allow"
)


def output_at_the_edge(values: Values) -> float:
    """Output at the edge of view, as a share of the brightest; infinite where no cell below a gate sees the Sun."""
    edge = _AT_THE_EDGE * max(0.0, half_view_cosine(values))
    # rounding must not make a view of 120 deg a wider one
    return edge if edge < _ENDS_AT - 1e-9 else math.inf


def dimmest_output(values: Values) -> float:
    """The same where cells below a gate may count at all."""
    return output_at_the_edge(values) if values[DIM_CELLS] else math.inf


class Gate(NamedTuple):
    """Which cells see the Sun."""

    relative: bool = made(
        lambda word: word == "relative",
        choice(
            "gate_kind", "relative", ("relative", "absolute"), "gate as a share of the brightest cell, or as an output"
        ),
    )
    level: float = given(
        real("gate", _ENDS_AT, "-", "a cell above the gate sees the Sun", low=0.0, high=1.0, tunable=True)
    )
    minimum_output: float = given(
        real("minimum_output", 0.1, "-", "no Sun unless a cell is above it", low=0.0, high=1.0, tunable=True)
    )
    dimmest: float = computed(dimmest_output, DIM_CELLS)  # as `level`, of a cell at the edge of its view


def gate_of_views(minimum_output: float, values: Values) -> Gate:
    """The gate that follows from the cells' views, with all defaults."""
    return Gate(True, _ENDS_AT, minimum_output, output_at_the_edge(values))


@kernel
def scale_of(gate: Gate, largest: float) -> float:
    """What the levels of a gate are shares of."""
    return largest if gate.relative else 1.0


@kernel
def lit_cells(layout: CellLayout, gate: Gate, voltages, top: int) -> tuple[bool, int]:
    """Whether there is a Sun, and the mask of the cells that see it: none if all are below an absolute gate.

    Args:
        voltages: (N,) cell outputs [-]; values that are not finite count as dark.
        top: result of `brightest`.
    """
    mask = 0
    if top < 0 or voltages[top] <= gate.minimum_output:
        return False, mask
    unit = scale_of(gate, voltages[top])
    level = gate.level * unit
    for i in range(voltages.shape[0]):
        if voltages[i] > level and voltages[i] < READABLE:
            mask |= 1 << i
    if gate.dimmest < gate.level:
        mask = _with_dim_cells(layout, gate.dimmest * unit, voltages, mask)
    return True, mask


@kernel
def _with_dim_cells(layout: CellLayout, level: float, voltages, mask: int) -> int:
    """The mask with the cells above `level` that share a part of the sky with each one in it, the brighter first."""
    asked = mask
    # each round asks one cell
    for _ in range(voltages.shape[0]):
        next_one = -1
        brightest_left = level
        for i in range(voltages.shape[0]):
            if asked >> i & 1 == 0 and brightest_left < voltages[i] < READABLE:
                next_one, brightest_left = i, voltages[i]
        if next_one < 0:
            break
        asked |= 1 << next_one
        if share_view(layout, next_one, mask):
            mask |= 1 << next_one
    return mask
