# SPDX-License-Identifier: Apache-2.0
"""Weighted-average Sun heading (O'Keefe & Schaub 2013, Eq. 2).

The sum runs over the cells that see the Sun, and the gate decides which these are. Light reflected by the
Earth gives a cell up to a quarter of the direct Sun (half of it on polar orbits): without a gate such cells
drag the heading by tens of degrees. A gate relative to the brightest cell keeps the method's main virtue,
that a scale common to all cells has no effect; an absolute gate does not.

Modes: 0 no Sun, 1 average of several cells, 2 a single cell (the error can reach its half view), 3
brightest cell below an absolute gate.
"""

from typing import NamedTuple

from css_common.kernel import kernel
from css_common.schema import Table, Values, choice, flag, real
from css_common.vectors import Vec3, norm, scale
from css_estimation import sun_tracking
from css_estimation.cell_layout import READABLE, CellLayout, brightest, cell_layout
from css_estimation.sun_heading import NO_COVARIANCE, VALIDITY_NONE, VALIDITY_VALID, SunHeading
from css_estimation.sun_tracking import (
    Estimate,
    TrackingParameters,
    TrackingState,
    elapsed,
    finish_cycle,
    gyro_usable,
    turned_sun,
)

PARAMETERS: Table = (
    choice("gate_kind", "relative", ("relative", "absolute"), "gate as a share of the brightest cell, or as an output"),
    real("gate", 0.45, "-", "a cell above the gate sees the Sun", low=0.0, high=1.0, tunable=True),
    real("minimum_output", 0.1, "-", "no Sun unless a cell is above it", low=0.0, high=1.0, tunable=True),
    flag("propagate_held", True, "without Sun, turn the held vector with the gyro"),
    *sun_tracking.PARAMETERS,
)

MODE_NO_SUN = 0
MODE_AVERAGE = 1
MODE_SINGLE_CELL = 2
MODE_BELOW_GATE = 3

# Normals that cancel to less than this leave no direction.
_NO_DIRECTION = 1e-6


class Gate(NamedTuple):
    """Which cells see the Sun."""

    relative: bool
    level: float
    minimum_output: float


class WavgParameters(NamedTuple):
    """Built by `parameters`."""

    layout: CellLayout
    gate: Gate
    propagate_held: bool
    tracking: TrackingParameters


def parameters(values: Values) -> WavgParameters:
    """Parameters from checked values (`PARAMETERS` and the mission's `cells`)."""
    return WavgParameters(
        layout=cell_layout(values),
        gate=Gate(values.gate_kind == "relative", values.gate, values.minimum_output),
        propagate_held=values.propagate_held,
        tracking=sun_tracking.parameters(values),
    )


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
    if top < 0 or voltages[top] <= gate.minimum_output:
        return (0.0, 0.0, 0.0), 0, MODE_NO_SUN
    level = gate.level * voltages[top] if gate.relative else gate.level
    x = y = z = 0.0
    mask = 0
    count = 0
    for i in range(voltages.shape[0]):
        if voltages[i] > level and voltages[i] < READABLE:
            x += voltages[i] * cells[i].nx
            y += voltages[i] * cells[i].ny
            z += voltages[i] * cells[i].nz
            mask |= 1 << i
            count += 1
    if count == 0:
        return (cells[top].nx, cells[top].ny, cells[top].nz), 1 << top, MODE_BELOW_GATE
    length = norm((x, y, z))
    if length < _NO_DIRECTION:
        return (0.0, 0.0, 0.0), 0, MODE_NO_SUN
    return scale(1.0 / length, (x, y, z)), mask, MODE_AVERAGE if count > 1 else MODE_SINGLE_CELL


@kernel
def step(
    p: WavgParameters,
    state: TrackingState,
    dt: float,
    voltages,
    gyro_b: Vec3,
    gyro_valid: bool,
    eclipse_predicted: int,
) -> tuple[TrackingState, SunHeading]:
    """One cycle; arguments in `css_estimation.sun_heading`."""
    dt = elapsed(dt)
    gyro_ok = gyro_usable(p.tracking, gyro_b, gyro_valid)
    top = brightest(voltages)
    sun_b, lit_mask, mode = weighted_average(p.layout, p.gate, voltages, top)
    valid = mode != MODE_NO_SUN
    if not valid and state.validity != VALIDITY_NONE:
        sun_b = state.sun_b
        if p.propagate_held and gyro_ok:
            sun_b = turned_sun(sun_b, gyro_b, dt)
    restarted = state.validity != VALIDITY_VALID
    estimate = Estimate(sun_b, NO_COVARIANCE, valid, restarted, 0.0, 0, lit_mask, mode)
    largest = voltages[top] if top >= 0 else 0.0
    return finish_cycle(p.tracking, state, dt, largest, gyro_b, gyro_ok, eclipse_predicted, estimate)
