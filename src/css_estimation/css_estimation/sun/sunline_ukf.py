# SPDX-License-Identifier: Apache-2.0
"""Square-root unscented filter on the Sun vector and its rate, after the documentation of Basilisk's `sunlineUKF`.

States: the Sun vector d in b, whose length is the light, and its rate d' in b [1/s]. The part of d' along d shows in no
cell and is taken off; the rest moves d on a straight line. Lit cells alone enter, V_i = n_i.d.

A step at a large angle stretches d. Cells set its length again; in the dark it is kept.

Modes as in `unscented_cycle`.
"""

from typing import NamedTuple

from css_common.declared import builder, part, table_of
from css_common.kernel import kernel
from css_common.vectors import Vec3, cross, dot, norm, scale
from css_estimation.sun import unscented_cycle
from css_estimation.sun.sun_heading import Aiding, SunHeading
from css_estimation.sun.unscented import POINTS, UnscentedMemory, draw_points, gather_points, new_memory, update
from css_estimation.sun.unscented_cycle import (
    DEFAULTS,
    Cycle,
    Outcome,
    UnscentedParameters,
    UnscentedState,
    close_cycle,
    direction_of,
    is_sound,
    open_cycle,
    start,
    sure_rate,
    turn_points,
)

_RATES = 3
_NO_LENGTH = 1e-300


class SunlineUkfParameters(NamedTuple):
    """All of the estimator."""

    filter: UnscentedParameters = part(UnscentedParameters)


PARAMETERS = table_of(SunlineUkfParameters, **DEFAULTS)
parameters = builder(SunlineUkfParameters)
initial_state = unscented_cycle.initial_state
heading_gain = unscented_cycle.heading_gain


def initial_memory(p: SunlineUkfParameters) -> UnscentedMemory:
    """No estimate yet."""
    return new_memory(len(p.filter.layout.cells))


@kernel
def move_point(x, dt: float) -> None:
    """A point (6,) after `dt` [s]."""
    length2 = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
    along = (x[3] * x[0] + x[4] * x[1] + x[5] * x[2]) / length2 if length2 > 0.0 else 0.0
    for a in range(3):
        x[3 + a] -= along * x[a]
    for a in range(3):
        x[a] += dt * x[3 + a]


@kernel
def _rate(memory: UnscentedMemory) -> Vec3:
    """Body rate across the Sun line [rad/s]: d' = d x omega."""
    d = direction_of(memory)
    return scale(1.0 / dot(d, d), cross((memory.x[3], memory.x[4], memory.x[5]), d))


@kernel
def predict(p: UnscentedParameters, cycle: Cycle, memory: UnscentedMemory) -> bool:
    """Moves the estimate on; False when it is lost."""
    length = norm(direction_of(memory))
    draw_points(p.points, memory)
    if cycle.steered:
        turn_points(cycle.rate_b, cycle.dt, memory)
    else:
        for i in range(POINTS):
            move_point(memory.points[i], cycle.dt)
    q, r = p.process_noise * cycle.dt, p.rate_noise * cycle.dt
    sound = gather_points(p.points, (q, q, q, r, r, r), memory)
    if not cycle.lit:
        k = length / max(norm(direction_of(memory)), _NO_LENGTH)
        for a in range(3):
            memory.x[a] *= k
    if cycle.steered:
        memory.x[3], memory.x[4], memory.x[5] = cross(direction_of(memory), cycle.rate_b)
        sure_rate(memory.root, _RATES, cycle.rate_variance)
    return sound and is_sound(p, norm(direction_of(memory)), memory)


@kernel
def measure(p: UnscentedParameters, lit_mask: int, voltages, memory: UnscentedMemory) -> tuple[bool, float, int]:
    """Updates with the lit cells; gives whether the estimate is still one, NIS, and how many cells."""
    cells, points = p.layout.cells, memory.points
    count = 0
    for i in range(voltages.shape[0]):
        if lit_mask >> i & 1:
            memory.readings[count] = voltages[i]
            for j in range(POINTS):
                memory.outputs[j, count] = (
                    cells[i].nx * points[j, 0] + cells[i].ny * points[j, 1] + cells[i].nz * points[j, 2]
                )
            count += 1
    sound, nis = update(p.points, memory, count, p.cell_variance)
    return sound and is_sound(p, norm(direction_of(memory)), memory), nis, count


@kernel
def begin(p: UnscentedParameters, cycle: Cycle, voltages, memory: UnscentedMemory) -> bool:
    """Starts with the weighted average."""
    v, w = p.initial_variance, p.initial_rate_variance
    return start(p, cycle, voltages, 0.0, (v, v, v, w, w, w), memory)


@kernel
def step(
    p: SunlineUkfParameters,
    state: UnscentedState,
    memory: UnscentedMemory,
    dt: float,
    voltages,
    aiding: Aiding,
) -> tuple[UnscentedState, SunHeading]:
    """One cycle; arguments in `css_estimation.sun.sun_algorithm`."""
    f = p.filter
    cycle = open_cycle(f, state, dt, voltages, aiding, memory)
    started = cycle.started and predict(f, cycle, memory)
    restarted = False
    nis, count, mask = 0.0, 0, 0
    if cycle.lit:
        if not started:
            started = restarted = begin(f, cycle, voltages, memory)
        if started:
            if restarted or f.points.redraw:
                draw_points(f.points, memory)
            sound, nis, count = measure(f, cycle.lit_mask, voltages, memory)
            mask = cycle.lit_mask
            if not sound:
                nis, count = 0.0, 0
                started = restarted = begin(f, cycle, voltages, memory)
    rate = _rate(memory) if started else (0.0, 0.0, 0.0)
    outcome = Outcome(started, restarted, 0, rate, nis, count, mask, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    return close_cycle(f, state, cycle, aiding, outcome, memory)
