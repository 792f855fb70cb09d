# SPDX-License-Identifier: Apache-2.0
"""One cycle of the Kalman filter on the Sun direction (O'Keefe & Schaub 2013, Eqs. 3-14).

State: the unit vector sun_b; continuous propagation with the body rate, one scalar update a cell in Joseph
form.

Which cells enter decides whether the filter works. Used are the cells that the propagated estimate puts in
the Sun's view, whatever they read (a dark one says where the Sun is not), and those brighter than a gate
relative to the brightest. A cell below the gate may be lit by the Earth alone; where its field of view lets it read so
little of the Sun (`lit_cells`), it is used if the Sun may be in its view within the error of the prediction.

Missing cells (NaN). A dark cell by itself says that the Sun is not in front of it; that it is just beside takes a cell
that looks the other way and is dark too. Where that one is missing, the dark one is left out.

Norm. The paper says nothing about the length of the state. Here it is set to one after each cycle, and the
covariance is told so: tangent variance stays, variance along the Sun line becomes what tangent errors leave
there, e^2/2, whose second moment is trace^2/2. Far from convergence the filter so stays the linear one that
finds the Sun from anywhere; once converged it is consistent on the two axes that exist.

Darkness. Without light, and with that of a Sun that sets (`fading`), the filter only propagates. Without gyro too,
nothing is known about the motion: a larger process noise says so, and a state less certain than a fresh one is replaced
at the next light. To `ekf` the same goes for a motion that is known from estimates alone whose cells do not span space:
what these leave open was made up by the estimate.

The filter follows one Sun. `ekf` (`sunline_ekf`) knows of another one that explains its cells as well; what watches the
gyro (`health.gyroless_sight`) flies the filter as it stands here.

Modes: 0 waiting for light, 1 started by the weighted average in this cycle, 2 tracking, 3 propagating with a
measured rate, 4 propagating without one.
"""

from typing import NamedTuple

from css_common.conversions import square
from css_common.declared import computed, given, made, part
from css_common.kernel import kernel
from css_common.schema import choice, real
from css_estimation.sun import sun_tracking
from css_estimation.sun.cell_layout import CellLayout, brightest, cell_layout
from css_estimation.sun.eclipse_detector import detect_eclipse
from css_estimation.sun.fading import KNOWN_TURN, LightNow, cells_that_see, light_on, tells_light
from css_estimation.sun.left_open import surely_spans_space
from css_estimation.sun.lit_cells import CELL_SIGMA, DIM_CELLS, Gate, dimmest_output, lit_cells
from css_estimation.sun.snapshot import MODE_NO_SUN
from css_estimation.sun.sun_heading import NO_COVARIANCE, RATE_NONE, Aiding, SunHeading
from css_estimation.sun.sun_tracking import (
    Estimate,
    TrackingParameters,
    TrackingState,
    elapsed,
    finish_cycle,
    gyro_usable,
    watch_light,
)
from css_estimation.sun.sunline_filter import constrain, propagate, update_cells
from css_estimation.sun.wavg import weighted_average
from css_estimation.symmetric import Symmetric, isotropic, row_major, trace

MODE_WAITING = 0
MODE_STARTED = 1
MODE_TRACKING = 2
MODE_PROPAGATING = 3
MODE_COASTING = 4


_GATE = real(
    "gate",
    0.4,
    "-",
    "share of the brightest cell above which a cell is used",
    low=0.0,
    high=1.0,
    tunable=True,
)
_MINIMUM = real("minimum_output", 0.3, "-", "no update unless a cell is above it", low=0.0, high=1.0, tunable=True)

PROCESS_SIGMA = real(
    "process_sigma", 0.01, "rad/sqrt(s)", "drift of the Sun line, 1 sigma", low=0.0, high=10.0, tunable=True
)


class SunlineParameters(NamedTuple):
    """Variances in rad^2, process noise in rad^2/s."""

    layout: CellLayout = computed(cell_layout)
    gate: Gate = computed(
        lambda values: Gate(True, values[_GATE], values[_MINIMUM], dimmest_output(values)), _GATE, _MINIMUM, DIM_CELLS
    )
    cell_variance: float = made(square, CELL_SIGMA)
    process_noise: float = made(square, PROCESS_SIGMA)
    process_noise_without_rate: float = made(
        square,
        real(
            "process_sigma_without_rate",
            0.1,
            "rad/sqrt(s)",
            "the same while no rate is measured, 1 sigma",
            low=0.0,
            high=10.0,
            tunable=True,
        ),
    )
    initial_variance: float = made(
        square, real("initial_sigma", 1.0, "rad", "error of the start, 1 sigma", low=0.0, open_low=True, high=2.0)
    )
    largest_variance: float = given(
        real("largest_variance", 4.0, "rad^2", "cap on the diagonal of the covariance", low=0.01, high=100.0)
    )
    propagate_filtered: bool = made(
        lambda word: word == "filtered",
        choice(
            "propagate_with", "measured", ("measured", "filtered"), "gyro rate as measured, or as low-pass filtered"
        ),
    )
    tracking: TrackingParameters = part(TrackingParameters)


class SunlineState(NamedTuple):
    """Carried from cycle to cycle; sun_b is in `tracking`."""

    started: bool
    covariance: Symmetric
    tracking: TrackingState


class Outcome(NamedTuple):
    """What a cycle made of outputs and rate, before its rate, age and validity are known (`close_cycle`)."""

    started: bool
    covariance: Symmetric  # of the filter
    top: int  # result of `brightest`
    largest: float  # [-] that output; 0: none
    gyro_ok: bool  # result of `gyro_usable`
    estimate: Estimate


def initial_state(p: SunlineParameters) -> SunlineState:
    """Waiting for light."""
    return SunlineState(False, (p.initial_variance, 0.0, 0.0) * 2, sun_tracking.initial_state())


@kernel
def _shows_motion(p: SunlineParameters, voltages, top: int) -> bool:
    """Whether lit cells show how the Sun moves: where they do not span space successive estimates are no rate."""
    return surely_spans_space(p.layout.cells, lit_cells(p.layout, p.gate, voltages, top)[1])


@kernel
def filter_cycle(
    p: SunlineParameters, state: SunlineState, dt: float, voltages, aiding: Aiding, beyond_edge: bool
) -> Outcome:
    """Prediction, start and update of one cycle.

    Args:
        dt: `elapsed` time [s].
        voltages: (N,) cell outputs [-], NaN where one is missing.
        beyond_edge: what a dark cell says, as of `sunline_filter.update_cells`.
    """
    gyro_ok = gyro_usable(p.tracking, aiding)
    top = brightest(voltages)
    largest = voltages[top] if top >= 0 else 0.0
    lit = largest > p.gate.minimum_output

    tracking = state.tracking
    started = state.started
    sun_b = tracking.sun_b
    covariance = state.covariance
    rate_known = gyro_ok or tracking.rate_source != RATE_NONE
    if started:
        rate = aiding.gyro_b if gyro_ok and not p.propagate_filtered else tracking.omega_bn_b
        shown = rate_known and (gyro_ok or not (beyond_edge and lit) or _shows_motion(p, voltages, top))
        noise = p.process_noise if shown else p.process_noise_without_rate
        sun_b, covariance = propagate(sun_b, covariance, rate, dt, noise)

    sure = started and tells_light(tracking.light, trace(covariance))
    light = light_on(p.layout, sun_b, voltages, cells_that_see(p.layout, sun_b)) if sure else 0.0
    track, setting = watch_light(p.tracking, tracking, dt, aiding, lit, LightNow(light, KNOWN_TURN))
    lit = lit and not setting

    mode = MODE_PROPAGATING if rate_known else MODE_COASTING
    restarted = False
    nis = 0.0
    count = 0
    mask = 0
    if lit:
        mode = MODE_TRACKING
        if not started or trace(covariance) > 3.0 * p.initial_variance:
            average_b, _, average_mode = weighted_average(p.layout, p.gate, voltages, top)
            if average_mode != MODE_NO_SUN:
                sun_b = average_b
                covariance = isotropic(p.initial_variance)
                mode = MODE_STARTED
                started = restarted = True
    predicted_b = sun_b
    if lit and started:
        sun_b, covariance, nis, count, mask = update_cells(
            p.layout, p.gate, p.cell_variance, beyond_edge, 0.0, sun_b, covariance, voltages, top
        )
    if started:
        sun_b, covariance = constrain(sun_b, predicted_b, covariance, p.largest_variance)
    else:
        mode = MODE_WAITING

    estimate = Estimate(
        sun_b,
        row_major(covariance) if started else NO_COVARIANCE,
        lit and started,
        False,
        restarted,
        nis,
        count,
        mask,
        mode,
        track,
    )
    return Outcome(started, covariance, top, largest, gyro_ok, estimate)


@kernel
def close_cycle(
    p: SunlineParameters, state: SunlineState, dt: float, aiding: Aiding, outcome: Outcome
) -> tuple[SunlineState, SunHeading]:
    """Eclipse, rate, age and validity of a cycle.

    Args:
        dt: `elapsed` time [s].
        outcome: of `filter_cycle`.
    """
    eclipse = state.tracking.eclipse
    shadow = detect_eclipse(p.tracking.eclipse, eclipse, dt, outcome.largest, aiding.sky.predicted)
    tracking, heading = finish_cycle(p.tracking, state.tracking, dt, aiding, outcome.gyro_ok, shadow, outcome.estimate)
    return SunlineState(outcome.started, outcome.covariance, tracking), heading


@kernel
def step_alone(
    p: SunlineParameters, state: SunlineState, dt: float, voltages, aiding: Aiding
) -> tuple[SunlineState, SunHeading]:
    """One cycle of the filter that follows one Sun, and to which a dark cell is one at 90 deg from it."""
    dt = elapsed(dt)
    return close_cycle(p, state, dt, aiding, filter_cycle(p, state, dt, voltages, aiding, False))
