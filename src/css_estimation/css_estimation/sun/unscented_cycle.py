# SPDX-License-Identifier: Apache-2.0
"""What the two unscented Sun filters share: parameters, start, darkness, loss, and what they report.

Both carry six states of which the first three are along the Sun, and the next ones its motion. Light of the cells alone
moves them; a gyro, while it delivers, turns the heading in the dark. While the Sun sets (`fading`) the heading is held,
and without a gyro it is lost in the dark that follows.

A heading less certain than a fresh one is lost, as is a filter that has no covariance any more, or that nobody called
for long: the last heading is held, turned by what rate is known, until light starts the filter anew.

Modes: 0 waiting for light, 1 started by the weighted average in this cycle, 2 tracking, 3 propagating with the gyro,
4 propagating with the filter's own rate, 5 lost.
"""

import math
from typing import NamedTuple

from css_common.attitude import rotation_vector_to_dcm
from css_common.conversions import square
from css_common.declared import computed, given, made, part
from css_common.kernel import kernel
from css_common.schema import Values, real
from css_common.vectors import Vec3, dot, multiply, scale, unit
from css_estimation.sun import sun_tracking
from css_estimation.sun.cell_layout import CellLayout, brightest, cell_layout
from css_estimation.sun.eclipse_detector import detect_eclipse
from css_estimation.sun.fading import KNOWN_TURN, LightNow, LightTrack, cells_that_see, light_on, tells_light
from css_estimation.sun.lit_cells import CELL_SIGMA, Gate, lit_cells
from css_estimation.sun.snapshot import MODE_NO_SUN
from css_estimation.sun.square_root import set_diagonal
from css_estimation.sun.sun_heading import NO_COVARIANCE, VALIDITY_NONE, Aiding, Covariance, SunHeading
from css_estimation.sun.sun_tracking import (
    Estimate,
    TrackingParameters,
    TrackingState,
    elapsed,
    finish_with_rate,
    gyro_usable,
    turned_sun,
    watch_light,
)
from css_estimation.sun.sunline_cycle import (
    MODE_COASTING,
    MODE_PROPAGATING,
    MODE_STARTED,
    MODE_TRACKING,
    MODE_WAITING,
)
from css_estimation.sun.sunline_filter import constrain
from css_estimation.sun.unscented import POINTS, STATES, PointParameters, UnscentedMemory
from css_estimation.sun.wavg import weighted_average
from css_estimation.symmetric import Symmetric, row_major, trace

MODE_LOST = 5  # beside those of `sunline_cycle`

# A light shorter or longer by this factor than the normal Sun's is none.
_LIGHT_RANGE = 10.0

DEFAULTS = {"gate": 0.4, "minimum_output": 0.3}
"""Other defaults than those of headings without memory: as `sunline_ekf`, for a filter can wait for light."""

_DIRECTION_SIGMA = real(
    "process_sigma", 0.001, "rad/sqrt(s)", "drift of the Sun line, 1 sigma", low=0.0, high=10.0, tunable=True
)
_RATE_SIGMA = real(
    "rate_process_sigma",
    0.003,
    "rad/s/sqrt(s)",
    "drift of its rate by torques, 1 sigma",
    low=0.0,
    high=10.0,
    tunable=True,
)


class UnscentedParameters(NamedTuple):
    """Part of the parameters of such a filter; variances in rad^2, (rad/s)^2, noises in those per second."""

    layout: CellLayout = computed(cell_layout)
    gate: Gate = part(Gate)
    cell_variance: float = made(square, CELL_SIGMA)
    process_noise: float = made(square, _DIRECTION_SIGMA)
    rate_noise: float = made(square, _RATE_SIGMA)
    initial_variance: float = made(
        square, real("initial_sigma", 1.0, "rad", "error of the start, 1 sigma", low=0.0, open_low=True, high=2.0)
    )
    initial_rate_variance: float = made(
        square,
        real("initial_rate_sigma", 0.1, "rad/s", "rate at the start, 1 sigma", low=0.0, open_low=True, high=2.0),
    )
    largest_variance: float = given(
        real("largest_variance", 4.0, "rad^2", "cap on the diagonal of the covariance", low=0.01, high=100.0)
    )
    longest_step: float = given(
        real("longest_step", 10.0, "s", "after a longer step the heading is lost", low=0.0, open_low=True, high=1e6)
    )
    points: PointParameters = part(PointParameters)
    tracking: TrackingParameters = part(TrackingParameters)


class UnscentedState(NamedTuple):
    """Carried from cycle to cycle beside the memory."""

    started: bool  # the memory holds an estimate
    axis: int  # of the body, which the frame of the rates is made with
    tracking: TrackingState


class Cycle(NamedTuple):
    """What is known before the filter's own part of a cycle."""

    dt: float  # [s]
    gyro_ok: bool
    top: int
    largest: float
    lit: bool  # cells see the Sun
    lit_mask: int  # which
    started: bool  # there is an estimate to go on with
    steered: bool  # by the rate that follows: in the dark by the gyro, while the Sun sets without one by none
    rate_b: Vec3  # [rad/s]
    rate_variance: float  # [rad^2/s^2]
    light: LightTrack


class Outcome(NamedTuple):
    """What the filter's own part came to."""

    started: bool  # there is an estimate
    restarted: bool
    axis: int
    rate_b: Vec3  # [rad/s] across the Sun line
    nis: float
    cells: int  # that contributed
    mask: int  # which
    left_open: Symmetric  # variance of the direction beside that of the states


def initial_state(p: object) -> UnscentedState:
    """Waiting for light."""
    return UnscentedState(False, 0, sun_tracking.initial_state())


def heading_gain(values: Values) -> float:
    """Steady gain of direction across the Sun line at one cell's worth of information in a cycle.

    The Riccati equation of direction and rate, by repetition.
    """
    dt, r = values.mission.period, values[CELL_SIGMA] ** 2
    direction, both, rate = 1.0, 0.0, 0.01
    gain = 0.0
    for _ in range(10_000):
        direction += dt * (2.0 * both + dt * rate) + values[_DIRECTION_SIGMA] ** 2 * dt
        both += dt * rate
        rate += values[_RATE_SIGMA] ** 2 * dt
        gain, of_rate = direction / (direction + r), both / (direction + r)
        rate -= of_rate * both
        both -= of_rate * direction
        direction -= gain * direction
    return gain


@kernel
def open_cycle(
    p: UnscentedParameters, state: UnscentedState, dt: float, voltages, aiding: Aiding, memory: UnscentedMemory
) -> Cycle:
    """The part before the filter's own; arguments in `css_estimation.sun.sun_algorithm`."""
    dt = elapsed(dt)
    gyro_ok = gyro_usable(p.tracking, aiding)
    top = brightest(voltages)
    _, mask = lit_cells(p.layout, p.gate, voltages, top)
    started = state.started and dt <= p.longest_step
    tracking = state.tracking
    light = 0.0
    if started and tells_light(tracking.light, trace(direction_covariance(memory))):
        sun_b = turned_sun(tracking.sun_b, aiding.gyro_b if gyro_ok else tracking.omega_bn_b, dt)
        light = light_on(p.layout, sun_b, voltages, cells_that_see(p.layout, sun_b))
    track, setting = watch_light(p.tracking, tracking, dt, aiding, mask != 0, LightNow(light, KNOWN_TURN))
    if setting:
        mask = 0
    elif mask == 0 and track.before > 0.0 and not gyro_ok:
        # the motion was last seen before the Sun began to set
        started = False
    largest = voltages[top] if top >= 0 else 0.0
    rate = aiding.gyro_b if gyro_ok else (0.0, 0.0, 0.0)
    rate_variance = p.rate_noise if gyro_ok else p.initial_rate_variance
    steered = mask == 0 and (gyro_ok or setting)
    return Cycle(dt, gyro_ok, top, largest, mask != 0, mask, started, steered, rate, rate_variance, track)


@kernel
def start(p: UnscentedParameters, cycle: Cycle, voltages, last: float, variances, memory: UnscentedMemory) -> bool:
    """The weighted average as estimate, at rest; False when there is none.

    Args:
        last: the last state.
        variances: of the six states.
    """
    average_b, _, mode = weighted_average(p.layout, p.gate, voltages, cycle.top)
    if mode == MODE_NO_SUN:
        return False
    for a in range(3):
        memory.x[a], memory.x[3 + a] = average_b[a], 0.0
    memory.x[5] = last
    set_diagonal(memory.root, variances)
    return True


@kernel
def direction_of(memory: UnscentedMemory) -> Vec3:
    """The first three states."""
    return memory.x[0], memory.x[1], memory.x[2]


@kernel
def direction_covariance(memory: UnscentedMemory) -> Symmetric:
    """Their covariance."""
    r = memory.root
    a, b, c = (r[0, 0], 0.0, 0.0), (r[1, 0], r[1, 1], 0.0), (r[2, 0], r[2, 1], r[2, 2])
    return dot(a, a), dot(a, b), dot(a, c), dot(b, b), dot(b, c), dot(c, c)


@kernel
def turn_points(omega_bn_b: Vec3, dt: float, memory: UnscentedMemory) -> None:
    """Turns the direction of each point by a gyro's rate; the rest of it stays."""
    dcm = rotation_vector_to_dcm(scale(dt, omega_bn_b))
    for i in range(POINTS):
        x = memory.points[i]
        x[0], x[1], x[2] = multiply(dcm, (x[0], x[1], x[2]))


@kernel
def sure_rate(root, size: int, variance: float) -> None:
    """Makes the `size` states from the fourth on independent of all others, with one variance."""
    for a in range(3, 3 + size):
        for b in range(STATES):
            root[a, b] = 0.0
            if b >= a:
                root[b, a] = 0.0
        root[a, a] = math.sqrt(variance)


@kernel
def is_sound(p: UnscentedParameters, light: float, memory: UnscentedMemory) -> bool:
    """Whether an estimate is worth going on with.

    Args:
        light: length of the Sun vector or output of a cell that faces the Sun, 1 for the normal Sun.
    """
    largest = 3.0 * p.initial_variance * max(1.0, light * light)
    # NaNs compare false
    return 1.0 / _LIGHT_RANGE < light < _LIGHT_RANGE and trace(direction_covariance(memory)) <= largest


@kernel
def _held(state: TrackingState, cycle: Cycle, aiding: Aiding) -> Vec3:
    """The last heading, turned by the rate that is known; zeros where there has been none."""
    if state.validity == VALIDITY_NONE:
        return state.sun_b
    return turned_sun(state.sun_b, aiding.gyro_b if cycle.gyro_ok else state.omega_bn_b, cycle.dt)


@kernel
def _mode(cycle: Cycle, outcome: Outcome, validity: int) -> int:
    if not outcome.started:
        return MODE_WAITING if validity == VALIDITY_NONE else MODE_LOST
    if cycle.lit:
        return MODE_STARTED if outcome.restarted else MODE_TRACKING
    return MODE_PROPAGATING if cycle.gyro_ok else MODE_COASTING


@kernel
def _reported(
    p: UnscentedParameters, sun: Vec3, length: float, left_open: Symmetric, memory: UnscentedMemory
) -> Covariance:
    """Covariance of the direction: that of the Sun vector over its length, on the plane across it."""
    c, o = direction_covariance(memory), left_open
    k = 1.0 / (length * length)
    both = (k * c[0] + o[0], k * c[1] + o[1], k * c[2] + o[2], k * c[3] + o[3], k * c[4] + o[4], k * c[5] + o[5])
    _, across = constrain(sun, sun, both, p.largest_variance)
    return row_major(across)


@kernel
def close_cycle(
    p: UnscentedParameters,
    state: UnscentedState,
    cycle: Cycle,
    aiding: Aiding,
    outcome: Outcome,
    memory: UnscentedMemory,
) -> tuple[UnscentedState, SunHeading]:
    """The part after the filter's own."""
    tracking = state.tracking
    covariance = NO_COVARIANCE
    if outcome.started:
        vector = direction_of(memory)
        sun = unit(vector)
        covariance = _reported(p, sun, dot(sun, vector), outcome.left_open, memory)
    else:
        sun = _held(tracking, cycle, aiding)
    limit = p.tracking.rate_limit
    r = outcome.rate_b
    rate = (min(max(r[0], -limit), limit), min(max(r[1], -limit), limit), min(max(r[2], -limit), limit))
    estimate = Estimate(
        sun,
        covariance,
        cycle.lit and outcome.started,
        False,
        outcome.restarted,
        outcome.nis,
        outcome.cells,
        outcome.mask,
        _mode(cycle, outcome, tracking.validity),
        cycle.light,
    )
    shadow = detect_eclipse(p.tracking.eclipse, tracking.eclipse, cycle.dt, cycle.largest, aiding.sky.predicted)
    tracking, heading = finish_with_rate(p.tracking, tracking, cycle.dt, aiding, cycle.gyro_ok, shadow, estimate, rate)
    return UnscentedState(outcome.started, outcome.axis, tracking), heading
