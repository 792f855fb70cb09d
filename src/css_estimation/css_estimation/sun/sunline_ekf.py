# SPDX-License-Identifier: Apache-2.0
"""Extended Kalman filter on the Sun direction (O'Keefe & Schaub 2013, Eqs. 3-14), and the other Sun beside it.

The filter itself, what it does with dim and missing cells and in darkness, and its modes stand in `sunline_cycle`.

Two Suns. Where the cells that inform it do not span space the filter follows one of two directions, and knows of the
other one (`other_sun`). If that turns out to be the right one the filter goes on from there: mode 1, as at its start.

Dark cells. Where the lit ones do not span space, one with a narrow view says that the Sun is beyond its edge, not that
it is 90 deg away.
"""

import math
from typing import NamedTuple

from css_common.declared import builder, part, table_of
from css_common.kernel import kernel
from css_common.schema import Values
from css_estimation.sun import sunline_cycle
from css_estimation.sun.lit_cells import CELL_SIGMA
from css_estimation.sun.other_sun import Followed, OtherSun, follow_other, no_other_sun, with_other
from css_estimation.sun.sun_algorithm import no_memory
from css_estimation.sun.sun_heading import Aiding, SunHeading
from css_estimation.sun.sun_tracking import Estimate, elapsed
from css_estimation.sun.sunline_cycle import (
    MODE_STARTED,
    PROCESS_SIGMA,
    Outcome,
    SunlineParameters,
    SunlineState,
    close_cycle,
    filter_cycle,
)


class EkfParameters(NamedTuple):
    """Parameters."""

    sunline: SunlineParameters = part(SunlineParameters)


PARAMETERS = table_of(EkfParameters)
parameters = builder(EkfParameters)


class EkfState(NamedTuple):
    """Carried from cycle to cycle."""

    sunline: SunlineState
    other: OtherSun


def heading_gain(values: Values) -> float:
    """Steady gain of the filter across the Sun line at one cell's worth of information in a cycle.

    P = P - P^2 / (P + R) + Q h, solved for the covariance P before an update.
    """
    q, r = values[PROCESS_SIGMA] ** 2 * values.mission.period, values[CELL_SIGMA] ** 2
    before = 0.5 * (q + math.sqrt(q * q + 4.0 * q * r))
    return before / (before + r)


initial_memory = no_memory


def initial_state(p: EkfParameters) -> EkfState:
    """Waiting for light."""
    return EkfState(sunline_cycle.initial_state(p.sunline), no_other_sun.py_func())


@kernel
def _beside_other(
    p: SunlineParameters, outcome: Outcome, other: OtherSun, dt: float, voltages, aiding: Aiding
) -> tuple[Outcome, OtherSun]:
    """What a cycle comes to beside the other Sun, and that one after it.

    Either the other Sun is part of the error that is reported, or the filter goes on from there.
    """
    e = outcome.estimate
    sun_b, covariance, mode, restarted = e.sun_b, outcome.covariance, e.mode, e.restarted
    rate_b = aiding.gyro_b if outcome.gyro_ok else (0.0, 0.0, 0.0)
    noise = p.process_noise if outcome.gyro_ok else p.process_noise_without_rate
    followed = Followed(p.layout, p.gate, p.cell_variance, sun_b, covariance, e.lit_mask, rate_b, noise, 1.0)
    other, taken = follow_other(followed, other, dt, voltages, outcome.top)
    if taken:
        sun_b, covariance, other = other.sun_b, other.covariance, no_other_sun()
        mode = MODE_STARTED
        restarted = True
    reported = with_other(other, sun_b, covariance, p.largest_variance)
    estimate = Estimate(sun_b, reported, e.valid, e.stands_in, restarted, e.nis, e.nis_dof, e.lit_mask, mode, e.light)
    return Outcome(True, covariance, outcome.top, outcome.largest, outcome.gyro_ok, estimate), other


@kernel
def step(
    p: EkfParameters,
    state: EkfState,
    memory: None,
    dt: float,
    voltages,
    aiding: Aiding,
) -> tuple[EkfState, SunHeading]:
    """One cycle; arguments in `css_estimation.sun.sun_algorithm`."""
    dt = elapsed(dt)
    other = state.other
    outcome = filter_cycle(p.sunline, state.sunline, dt, voltages, aiding, True)
    if outcome.started:
        outcome, other = _beside_other(p.sunline, outcome, other, dt, voltages, aiding)
    sunline, heading = close_cycle(p.sunline, state.sunline, dt, aiding, outcome)
    return EkfState(sunline, other), heading
