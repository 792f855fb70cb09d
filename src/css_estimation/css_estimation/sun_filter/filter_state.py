# SPDX-License-Identifier: Apache-2.0
"""What the Sun filter carries from cycle to cycle beside its memory, its stages, and its modes."""

import math
from typing import NamedTuple

from css_common.kernel import kernel
from css_common.vectors import Vec3
from css_estimation.sun import eclipse_detector
from css_estimation.sun.eclipse_detector import EclipseState
from css_estimation.sun.low_pass import low_pass, low_pass_gain
from css_estimation.sun.other_sun import OtherSun, no_other_sun
from css_estimation.sun.sun_heading import VALIDITY_NONE
from css_estimation.sun_filter.motion import RATE_BY_GYRO, RATE_BY_WALK
from css_estimation.sun_filter.options import SunFilterParameters

MODE_WAITING = 0
MODE_SEARCHING = 1
MODE_CONVERGING = 2
MODE_ROLLS = 3
MODE_EARTH = 4
MODE_NO_EARTH = 5
MODE_COASTING = 6

STAGE_SEARCH, STAGE_HEADING, STAGE_ROLL = 0, 1, 2

NO_RATE: Vec3 = (0.0, 0.0, 0.0)


class Progress(NamedTuple):
    """How far the filter has come."""

    stage: int  # STAGE_*
    begun: bool  # light has been seen since the search began
    since: float  # [s] of light in this stage
    contrary: float  # share of late cycles that contradict the estimate
    faded: float  # [s] how long outputs have been too low


class Rate(NamedTuple):
    """How the body turns."""

    model: int  # RATE_BY_*
    raw_b: Vec3  # [rad/s] in the last cycle
    omega_bn_b: Vec3  # [rad/s] as reported


class Found(NamedTuple):
    """The Sun by the search alone."""

    sun_b: Vec3
    variance: float  # [rad2] on the worst axis


class SunFilterState(NamedTuple):
    """Carried from cycle to cycle beside the memory."""

    progress: Progress
    rate: Rate
    found: Found
    validity: int
    age: float  # [s]
    eclipse: EclipseState
    other: OtherSun


class Cycle(NamedTuple):
    """What both ways of going on are given."""

    dt: float  # [s]
    flux: float  # [-] of the Sun
    lit: bool  # cells may be used
    model: int  # RATE_BY_* of this cycle
    wheels_b: Vec3  # [N m s]


AFRESH = Progress(STAGE_SEARCH, False, 0.0, 0.0, 0.0)
NOT_FOUND = Found((0.0, 0.0, 1.0), math.pi)


def initial_state(p: SunFilterParameters) -> SunFilterState:
    """Nothing known."""
    rate = Rate(RATE_BY_WALK, NO_RATE, NO_RATE)
    return SunFilterState(
        AFRESH, rate, NOT_FOUND, VALIDITY_NONE, 0.0, eclipse_detector.initial_state(), no_other_sun.py_func()
    )


@kernel
def filtered_rate(p: SunFilterParameters, rate: Rate, cycle: Cycle, raw_b: Vec3) -> Rate:
    """The rate as reported: a gyro's through the low-pass filter, another as it is: the filter has smoothed it."""
    omega_bn_b = raw_b
    if cycle.model == RATE_BY_GYRO:
        omega_bn_b = low_pass(rate.omega_bn_b, raw_b, low_pass_gain(p.motion.cutoff, cycle.dt))
    return Rate(cycle.model, raw_b, omega_bn_b)
