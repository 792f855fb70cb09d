# SPDX-License-Identifier: Apache-2.0
"""Switch filter: Sun direction, the body rate across it, and the light (Teil, Schaub & Piggott 2020).

After the documentation of Basilisk's `sunlineSuKF`: a square-root unscented filter of the states that cells can show.
States: the direction d in b; the body rate omega_bn [rad/s] along s2 and s3 of the frame

    s1 = d,  s2 = unit(d x b_k),  s3 = s1 x s2,

the rate along s1 being unseen; the output of a cell that faces the Sun. Where d comes within 30 deg of the axis b_k or
its opposite the frame is made with the other one of b1 and b2 from there on, and the rates are turned into it: there is
no direction without a frame.

A step turns d about the rate, which is constant in b; the frame turns with d, and the rates are read off in it.

Cells that enter are the lit ones, and the ones in whose view the prediction puts the Sun, whatever they read, with
V_i = light max(0, n_i.d). Of missing cells the same holds as in `sunline_ekf`.

Where the lit cells do not span space, light and direction make up for one another, and which of two Suns it is nobody
knows; large errors of both soon pass for small ones. What these cells leave open (`left_open`) is then reported beside
the filter's own covariance.

Modes as in `unscented_cycle`.
"""

import math
from typing import NamedTuple

from css_common.conversions import square
from css_common.declared import builder, made, part, table_of
from css_common.kernel import kernel
from css_common.schema import real
from css_common.vectors import Vec3, add, cross, dot, norm, scale, unit
from css_estimation.sun import unscented_cycle
from css_estimation.sun.cell_layout import informs, missing_cells, view_margin
from css_estimation.sun.left_open import projection, second_moment, span_of, surely_spans_space
from css_estimation.sun.lit_cells import scale_of
from css_estimation.sun.square_root import add_vector
from css_estimation.sun.sun_heading import Aiding, SunHeading
from css_estimation.sun.sun_tracking import turned_sun
from css_estimation.sun.unscented import (
    POINTS,
    STATES,
    UnscentedMemory,
    draw_points,
    gather_points,
    new_memory,
    update,
)
from css_estimation.sun.unscented_cycle import (
    DEFAULTS,
    Cycle,
    Outcome,
    UnscentedParameters,
    UnscentedState,
    close_cycle,
    direction_covariance,
    direction_of,
    is_sound,
    open_cycle,
    start,
    sure_rate,
    turn_points,
)
from css_estimation.symmetric import Symmetric

_RATES = 2
_LIGHT = 5
_NEAR_AXIS = math.cos(math.radians(30.0))


class SunlineSuekfParameters(NamedTuple):
    """All of the estimator."""

    filter: UnscentedParameters = part(UnscentedParameters)
    light_noise: float = made(
        square,
        real("light_process_sigma", 1e-4, "1/sqrt(s)", "drift of the light, 1 sigma", low=0.0, high=1.0, tunable=True),
    )
    initial_light_variance: float = made(
        square,
        real("initial_light_sigma", 0.1, "-", "light less 1 at the start, 1 sigma", low=0.0, open_low=True, high=2.0),
    )


PARAMETERS = table_of(SunlineSuekfParameters, **DEFAULTS)
parameters = builder(SunlineSuekfParameters)
initial_state = unscented_cycle.initial_state
heading_gain = unscented_cycle.heading_gain


def initial_memory(p: SunlineSuekfParameters) -> UnscentedMemory:
    """No estimate yet."""
    return new_memory(len(p.filter.layout.cells))


@kernel
def rate_axes(direction: Vec3, axis: int) -> tuple[Vec3, Vec3]:
    """s2 and s3 in b, of a unit vector that is not along the axis."""
    body = (1.0, 0.0, 0.0) if axis == 0 else (0.0, 1.0, 0.0)
    s2 = unit(cross(direction, body))
    return s2, cross(direction, s2)


@kernel
def _across(w2: float, w3: float, axes: tuple[Vec3, Vec3]) -> Vec3:
    return add(scale(w2, axes[0]), scale(w3, axes[1]))


@kernel
def move_point(x, axis: int, dt: float) -> None:
    """A point (6,) after `dt` [s]."""
    sun_b = unit((x[0], x[1], x[2]))
    omega_b = _across(x[3], x[4], rate_axes(sun_b, axis))
    moved_b = turned_sun(sun_b, omega_b, dt)
    s2, s3 = rate_axes(moved_b, axis)
    for a in range(3):
        x[a] = moved_b[a]
    x[3], x[4] = dot(omega_b, s2), dot(omega_b, s3)


@kernel
def switch_axis(axis: int, memory: UnscentedMemory) -> int:
    """The axis to go on with; where it is another one, the rates and the root are turned into its frame."""
    sun_b = unit(direction_of(memory))
    # not sun_b[axis]: for all that the compiler knows that may be out of range
    if abs(sun_b[0] if axis == 0 else sun_b[1]) <= _NEAR_AXIS:
        return axis
    other = 1 - axis
    old2, old3 = rate_axes(sun_b, axis)
    new2, _ = rate_axes(sun_b, other)
    c, s = dot(new2, old2), dot(new2, old3)
    x, root, columns, work = memory.x, memory.root, memory.points, memory.work
    x[3], x[4] = c * x[3] + s * x[4], c * x[4] - s * x[3]
    for a in range(STATES):
        for b in range(STATES):
            columns[b, a] = root[a, b]
            root[a, b] = 0.0
    for b in range(STATES):
        for a in range(STATES):
            work[a] = columns[b, a]
        work[3], work[4] = c * columns[b, 3] + s * columns[b, 4], c * columns[b, 4] - s * columns[b, 3]
        add_vector(root, STATES, work)
    return other


@kernel
def predict(p: SunlineSuekfParameters, cycle: Cycle, axis: int, memory: UnscentedMemory) -> tuple[bool, int]:
    """Moves the estimate on; gives whether it is not lost, and the axis from here on."""
    f, x = p.filter, memory.x
    axis = switch_axis(axis, memory)
    draw_points(f.points, memory)
    if cycle.steered:
        turn_points(cycle.rate_b, cycle.dt, memory)
    else:
        for i in range(POINTS):
            move_point(memory.points[i], axis, cycle.dt)
    q, r, light = f.process_noise * cycle.dt, f.rate_noise * cycle.dt, p.light_noise * cycle.dt
    sound = gather_points(f.points, (q, q, q, r, r, light), memory) and _normalise(memory)
    if cycle.steered:
        s2, s3 = rate_axes(direction_of(memory), axis)
        x[3], x[4] = dot(cycle.rate_b, s2), dot(cycle.rate_b, s3)
        sure_rate(memory.root, _RATES, cycle.rate_variance)
    return sound and is_sound(f, x[_LIGHT], memory), axis


@kernel
def _normalise(memory: UnscentedMemory) -> bool:
    """Sets the length of the direction to one; False when there is none."""
    length = norm(direction_of(memory))
    # a NaN compares false
    if not length > 0.1:
        return False
    for a in range(3):
        memory.x[a] /= length
    return True


@kernel
def measure(p: UnscentedParameters, cycle: Cycle, voltages, memory: UnscentedMemory) -> tuple[bool, float, int, int]:
    """Updates with lit cells and those that should be.

    Returns:
        whether the estimate is still one, NIS, how many cells, their mask.
    """
    cells, points = p.layout.cells, memory.points
    predicted_b = direction_of(memory)
    missing, covariance = missing_cells(voltages), direction_covariance(memory)
    level = p.gate.level * scale_of(p.gate, cycle.largest)
    count = mask = 0
    for i in range(voltages.shape[0]):
        lit = cycle.lit_mask >> i & 1 == 1
        if not informs(
            p.layout, i, voltages[i], level, lit, predicted_b, view_margin(p.layout, i, covariance), missing
        ):
            continue
        memory.readings[count] = voltages[i]
        for j in range(POINTS):
            d = (points[j, 0], points[j, 1], points[j, 2])
            cosine = dot((cells[i].nx, cells[i].ny, cells[i].nz), unit(d))
            memory.outputs[j, count] = points[j, _LIGHT] * max(cosine, 0.0)
        mask |= 1 << i
        count += 1
    sound, nis = update(p.points, memory, count, p.cell_variance)
    return sound and _normalise(memory) and is_sound(p, memory.x[_LIGHT], memory), nis, count, mask


@kernel
def begin(p: SunlineSuekfParameters, cycle: Cycle, voltages, memory: UnscentedMemory) -> bool:
    """Starts with the weighted average."""
    f = p.filter
    v, w = f.initial_variance, f.initial_rate_variance
    return start(f, cycle, voltages, 1.0, (v, v, v, w, w, p.initial_light_variance), memory)


@kernel
def unseen(p: UnscentedParameters, cycle: Cycle, voltages, memory: UnscentedMemory) -> Symmetric:
    """What the lit cells of a cycle leave open of the direction; nothing where they span space, and in the dark."""
    cells = p.layout.cells
    if not cycle.lit or surely_spans_space(cells, cycle.lit_mask):
        return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    span = span_of(cells, cycle.lit_mask)
    if span.rank == 3:
        return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    projected = projection(p.layout, span, voltages, cycle.lit_mask)
    sigma = math.sqrt(p.cell_variance)
    return second_moment(p.layout, span, projected, cycle.lit_mask, sigma, unit(direction_of(memory)))


@kernel
def step(
    p: SunlineSuekfParameters,
    state: UnscentedState,
    memory: UnscentedMemory,
    dt: float,
    voltages,
    aiding: Aiding,
) -> tuple[UnscentedState, SunHeading]:
    """One cycle; arguments in `css_estimation.sun.sun_algorithm`."""
    f = p.filter
    cycle = open_cycle(f, state, dt, voltages, aiding, memory)
    started, axis = cycle.started, state.axis
    if started:
        started, axis = predict(p, cycle, axis, memory)
    restarted = False
    nis, count, mask = 0.0, 0, 0
    if cycle.lit:
        if not started:
            started = restarted = begin(p, cycle, voltages, memory)
        if started:
            if restarted or f.points.redraw:
                draw_points(f.points, memory)
            sound, nis, count, mask = measure(f, cycle, voltages, memory)
            if not sound:
                nis, count = 0.0, 0
                started = restarted = begin(p, cycle, voltages, memory)
    rate = (0.0, 0.0, 0.0)
    if started:
        axis = switch_axis(axis, memory)
        rate = _across(memory.x[3], memory.x[4], rate_axes(direction_of(memory), axis))
    left_open = unseen(f, cycle, voltages, memory) if started else (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    outcome = Outcome(started, restarted, axis, rate, nis, count, mask, left_open)
    return close_cycle(f, state, cycle, aiding, outcome, memory)
