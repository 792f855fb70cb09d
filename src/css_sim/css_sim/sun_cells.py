# SPDX-License-Identifier: Apache-2.0
"""Signal chain of cosine-type coarse sun sensor cells (O'Keefe & Schaub 2013, Eqs. 1 and 16).

For each cell, in this order:

    V  = f t max(0, n.s)     if the Sun is in the cone of view; t is what the screen (body plane, collar) lets pass, and
                             where structure blocks the cell 0; a table of angles may stand in the place of n.s
    V += albedo              light reflected by the Earth, computed elsewhere
    V  = 0                   if V is below the drop-out level
    V *= 1 + b^2/2 - 0.65 b^4     warp, with b = sin(arccos(V clipped to [0, 1]))
    V *= 1 + k (T - T0)      temperature T of the cell, which light warms
    V *= 1 - d               degradation, d uniform in [0, d_max), common to all cells or one per cell
    V  = gain V + bias + noise    errors of the individual cell
    faults                   dead, stuck, noisy and others (`fault_kinds`); a shadow acts on the light
    limits and quantisation  [low, high] in 2**bits levels

f is the solar flux relative to 1 AU times the visible fraction of the solar disc, n the true normal of the
cell, s the Sun in the body frame. Outputs are normalised: 1.0 is the Sun at normal incidence at 1 AU.
"""

import math
from typing import NamedTuple

import numpy as np

from css_common.declared import builder, computed, given, made, part, table_of
from css_common.kernel import kernel
from css_common.random_streams import RandomKey, Stream, uniform4
from css_common.schema import choice, flag, integer, real
from css_common.vectors import Vec3
from css_environment.albedo import Screen, is_blocked, transmission, view_cosine
from css_sensors.cells import half_view_cosine
from css_sim import cell_response, cell_screen
from css_sim.cell_faults import light_left
from css_sim.fault_effects import CELL, SHADOWED, any_acts, spoil
from css_sim.white_noise import add_noise

NOISE = real("noise", 0.0, "-", "1 sigma of the white noise of each sample", low=0.0, high=1.0, tunable=True)
OUTPUT_LOW = real("output_low", 0.0, "-", "lowest output", low=-10.0, high=10.0)
OUTPUT_HIGH = real("output_high", 2.0, "-", "highest output", low=-10.0, high=10.0)


def _levels(bits: int) -> float:
    return float(2**bits) if bits else 0.0


class Thermal(NamedTuple):
    """Temperature of the cells, which follows the light on them at once, and what it does to their outputs."""

    coefficient: float = given(
        real("thermal.coefficient", 0.0, "1/K", "relative change of a cell's output with its temperature",
             low=-0.1, high=0.1)
    )  # fmt: skip
    dark: float = made(  # [K] temperature in the dark, above the one at which the output is right
        lambda dark, reference: dark - reference,
        real("thermal.dark_temperature", 20.0, "degC", "temperature of a cell in the dark", low=-270.0, high=200.0),
        real("thermal.reference_temperature", 20.0, "degC", "that at which outputs are right", low=-270.0, high=200.0),
    )
    rise: float = given(
        real("thermal.rise", 0.0, "K", "how much warmer a cell is under the normal Sun", low=0.0, high=300.0)
    )


class SunCells(NamedTuple):
    """What all cells have in common in all cases; what differs is in `cell_errors.CELL` and `fault_effects.FAULT`."""

    screen: Screen = computed(cell_screen.screen)  # what hides part of the sky
    cos_half_view: float = computed(half_view_cosine)  # of the widest
    responses: np.ndarray = computed(  # (N, 91) outputs at angles 0, 1, ... 90 deg, (1, 91) for all; (0, 91): cosine
        cell_response.tables, *cell_response.PARAMETERS
    )
    thermal: Thermal = part(Thermal)
    warp: bool = given(flag("warp", True, "flattened response of O'Keefe & Schaub 2013, Eq. 16"))
    degradation: float = given(
        real("degradation", 0.05, "-", "largest loss of output, drawn anew every step", low=0.0, high=1.0, tunable=True)
    )
    degradation_per_cell: bool = made(
        lambda word: word == "per_cell",
        choice("degradation_mode", "common", ("common", "per_cell"), "one draw for all cells, or one for each"),
    )
    noise: float = given(NOISE)
    dropout: float = given(real("dropout", 0.0, "-", "light below this level gives no output", low=0.0, high=1.0))
    output_low: float = given(OUTPUT_LOW)
    output_high: float = given(OUTPUT_HIGH)
    levels: float = made(  # steps between lowest and highest output; 0: continuous
        _levels,
        integer("bits", 0, "-", "resolution between lowest and highest output; 0: continuous", low=0, high=32),
    )


PARAMETERS = table_of(SunCells)
parameters = builder(SunCells)


@kernel
def warped(v: float) -> float:
    """Response with a flattened peak (O'Keefe & Schaub 2013, Eq. 16)."""
    clipped = min(max(v, 0.0), 1.0)
    b2 = 1.0 - clipped * clipped
    return v * (1.0 + b2 * (0.5 - 0.65 * b2))


@kernel
def _draw_degradation(p: SunCells, key, step, factors_out) -> None:
    """Factors of this cycle that the cells' outputs are multiplied by."""
    n = factors_out.shape[0]
    if p.degradation <= 0.0 or not p.degradation_per_cell:
        factor = 1.0
        if p.degradation > 0.0:
            factor -= p.degradation * uniform4(key, Stream.CELL_DEGRADATION, step, 0)[0]
        for i in range(n):
            factors_out[i] = factor
        return
    for block in range((n + 3) // 4):
        draws = uniform4(key, Stream.CELL_DEGRADATION, step, 1 + block)
        first = 4 * block
        for j in range(min(4, n - first)):
            factors_out[first + j] = 1.0 - p.degradation * draws[j]


@kernel
def _limit(p: SunCells, voltages) -> int:
    """Outputs cut to the limits and rounded down as a converter does; mask of those at the top."""
    saturated = 0
    lsb = (p.output_high - p.output_low) / p.levels if p.levels > 0.0 else 0.0
    top = p.output_high - lsb
    for i in range(voltages.shape[0]):
        v = voltages[i]
        if v >= top:
            v = top
            saturated |= 1 << i
        elif not v > p.output_low:
            v = p.output_low
        elif lsb > 0.0:
            v = p.output_low + lsb * math.floor((v - p.output_low) / lsb)
        voltages[i] = v
    return saturated


@kernel
def _received(p: SunCells, i: int, side: float, cosine: float, sun_b: Vec3) -> float:
    """Sunlight [-] on cell `i`, which has a view or a response of its own, by the cosine of the Sun on it."""
    if cosine < view_cosine(p.screen, i, p.cos_half_view) or is_blocked(p.screen, i, sun_b):
        return 0.0
    received = max(0.0, cosine)
    if p.responses.shape[0] > 0:
        received = cell_response.response_at(p.responses, min(i, p.responses.shape[0] - 1), cosine)
    return received * transmission(p.screen, side, sun_b)


@kernel
def sample(
    p: SunCells,
    cells,
    faults,
    key: RandomKey,
    step: int,
    sun_b: Vec3,
    intensity: float,
    albedo,
    voltages_out,
) -> int:
    """Outputs of all cells at one control cycle; returns the mask of cells at their upper limit.

    Args:
        cells: (N,) of `cell_errors.CELL`.
        faults: (F,) of `fault_effects.FAULT`.
        step: number of the control cycle, which with `key` fixes all draws.
        sun_b: unit vector to the Sun.
        intensity: solar flux relative to 1 AU times the visible fraction of the disc [-].
        albedo: (N,) light reflected by the Earth that each cell receives [-].
        voltages_out: (N,) outputs [-], written.
    """
    # the outputs hold the factors until each is used
    _draw_degradation(p, key, step, voltages_out)
    # chosen once: cells that are alike cost no more than if others were not thought of
    alike = p.responses.shape[0] + p.screen.views.shape[0] + p.screen.blocked.shape[0] == 0
    shadowed = faults.shape[0] > 0 and any_acts(faults, CELL, SHADOWED, step)
    for i in range(voltages_out.shape[0]):
        cell = cells[i]
        v = albedo[i]
        cosine = cell.nx * sun_b[0] + cell.ny * sun_b[1] + cell.nz * sun_b[2]
        if not alike:
            v += intensity * _received(p, i, cell.side, cosine, sun_b)
        elif cosine >= p.cos_half_view:
            v += intensity * max(0.0, cosine) * transmission(p.screen, cell.side, sun_b)
        if shadowed:
            v *= light_left(faults, step, i)
        light = v
        if v < p.dropout:
            v = 0.0
        if p.warp:
            v = warped(v)
        if p.thermal.coefficient != 0.0:
            v *= max(0.0, 1.0 + p.thermal.coefficient * (p.thermal.dark + p.thermal.rise * light))
        voltages_out[i] = cell.gain * v * voltages_out[i] + cell.bias
    if p.noise > 0.0:
        add_noise(p.noise, key, Stream.CELL_NOISE, step, voltages_out)
    if faults.shape[0] > 0:
        spoil(faults, CELL, key, step, voltages_out)
    return _limit(p, voltages_out)
