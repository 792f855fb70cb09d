# SPDX-License-Identifier: Apache-2.0
"""What the control is doing: mode logic with hysteresis and debounce.

A mode is left only when another has been wanted for several samples in a row, so that no single sample,
however wrong, changes it, and the thresholds of entering and leaving differ, so that noise on one does not
chatter.

    SAFE             commanded, inputs that are no numbers, or too few actuators left: actuators at rest
    DETUMBLE         body rate too high for pointing: rate damping
    ECLIPSE          in the shadow
    SUN_SEARCH       sunlit, but no cell sees the Sun: scripted rotation about x, then y, then a rest, again
    SUN_ACQUISITION  turning to the Sun
    SUN_POINT        on the Sun

Where several apply, the first in this list is taken.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

from css_common.declared import builder, given, made, table_of
from css_common.kernel import kernel
from css_common.schema import Values, flag, integer, real
from css_common.vectors import Vec3

ENABLED = flag("enabled", True, "off: safe mode, actuators at rest", tunable=True)
DEBOUNCE = integer("modes.debounce", 3, "samples", "samples in a row that must want another mode", low=2, high=1000)
DETUMBLE_RATE = real(
    "modes.detumble_rate_deg_s", 10.0, "deg/s", "body rate above which it is damped first", low=0.0, high=360.0
)
DETUMBLE_EXIT_RATE = real(
    "modes.detumble_exit_rate_deg_s", 5.0, "deg/s", "body rate below which pointing resumes", low=0.0, high=360.0
)
POINT_ANGLE = real(
    "modes.point_angle_deg", 15.0, "deg", "pointing error below which it is on the Sun", low=0.0, high=180.0
)
ACQUIRE_ANGLE = real(
    "modes.acquire_angle_deg", 30.0, "deg", "pointing error above which it no longer is", low=0.0, high=180.0
)
_SEARCH_RATE = real("modes.search_rate_deg_s", 1.0, "deg/s", "body rate of the search", low=0.01, high=2.0)
_SEARCH_ANGLE = real(
    "modes.search_angle_deg", 360.0, "deg", "rotation about one axis before the next", low=1.0, high=3600.0
)

# The numbers of css_msgs/ControlStatus.
MODE_SAFE = 0
MODE_DETUMBLE = 1
MODE_SUN_SEARCH = 2
MODE_SUN_ACQUISITION = 3
MODE_SUN_POINT = 4
MODE_ECLIPSE = 5

REASON_NOMINAL = 0
REASON_RATE_HIGH = 1
REASON_NO_SUN = 2
REASON_POINTING_ERROR = 3
REASON_ON_SUN = 4
REASON_IN_SHADOW = 5
REASON_NO_RATE = 6
REASON_COMMANDED = 7
REASON_STALE_INPUT = 8
REASON_FAULT = 9

_SEARCH_PHASES = 3


class ModeParameters(NamedTuple):
    """Rates in rad/s, angles in rad, times in s."""

    enabled: bool = given(ENABLED)
    debounce: int = given(DEBOUNCE)
    detumble_rate: float = made(math.radians, DETUMBLE_RATE)
    detumble_exit_rate: float = made(math.radians, DETUMBLE_EXIT_RATE)
    point_angle: float = made(math.radians, POINT_ANGLE)
    acquire_angle: float = made(math.radians, ACQUIRE_ANGLE)
    search_wait: float = given(
        real("modes.search_wait", 20.0, "s", "sunlit time without Sun before the search begins", low=0.0, high=1e4)
    )
    search_rate: float = made(math.radians, _SEARCH_RATE)
    search_phase_time: float = made(lambda angle, rate: angle / rate, _SEARCH_ANGLE, _SEARCH_RATE)
    search_lit_time: float = given(
        real("modes.search_lit_time", 1.0, "s", "time with a valid Sun that ends the search", low=0.0, high=1e3)
    )


PARAMETERS = table_of(ModeParameters)
parameters = builder(ModeParameters)


class ModeState(NamedTuple):
    """Carried from cycle to cycle."""

    mode: int
    reason: int
    wanted: int  # mode that the last samples wanted
    wanted_count: int  # how many of them in a row
    sunless_time: float  # [s] sunlit, without a valid Sun
    lit_time: float  # [s] with a valid Sun
    search_time: float  # [s] in the search script


def conflicts(values: Values) -> Iterator[str]:
    """Thresholds whose hysteresis is upside down, one message each."""
    if values[DETUMBLE_EXIT_RATE] > values[DETUMBLE_RATE]:
        yield "modes.detumble_exit_rate_deg_s: above modes.detumble_rate_deg_s, expected at most that"
    if values[POINT_ANGLE] > values[ACQUIRE_ANGLE]:
        yield "modes.point_angle_deg: above modes.acquire_angle_deg, expected at most that"


def initial_state() -> ModeState:
    """Acquiring: the control acts from the first sample on."""
    return ModeState(MODE_SUN_ACQUISITION, REASON_NOMINAL, MODE_SUN_ACQUISITION, 0, 0.0, 0.0, 0.0)


@kernel
def wanted_mode(
    p: ModeParameters,
    state: ModeState,
    inputs_ok: bool,
    in_shadow: bool,
    pointing_error: float,
    rate: float,
    rate_known: bool,
    disabled: bool = False,
) -> tuple[int, int]:
    """Mode and reason that this sample alone asks for; arguments as in `next_mode`."""
    if not inputs_ok:
        return MODE_SAFE, REASON_STALE_INPUT
    if not p.enabled:
        return MODE_SAFE, REASON_COMMANDED
    if disabled:
        return MODE_SAFE, REASON_FAULT
    threshold = p.detumble_exit_rate if state.mode == MODE_DETUMBLE else p.detumble_rate
    if rate_known and rate > threshold:
        return MODE_DETUMBLE, REASON_RATE_HIGH
    if in_shadow:
        return MODE_ECLIPSE, REASON_IN_SHADOW if rate_known else REASON_NO_RATE
    if state.mode == MODE_SUN_SEARCH:
        if state.lit_time < p.search_lit_time:
            return MODE_SUN_SEARCH, REASON_NO_SUN
    elif state.sunless_time >= p.search_wait:
        return MODE_SUN_SEARCH, REASON_NO_SUN
    if pointing_error < 0.0:
        return MODE_SUN_ACQUISITION, REASON_NO_SUN
    threshold = p.acquire_angle if state.mode == MODE_SUN_POINT else p.point_angle
    if pointing_error < threshold:
        return MODE_SUN_POINT, REASON_ON_SUN
    return MODE_SUN_ACQUISITION, REASON_POINTING_ERROR


@kernel
def next_mode(
    p: ModeParameters,
    state: ModeState,
    dt: float,
    inputs_ok: bool,
    sun_valid: bool,
    in_shadow: bool,
    pointing_error: float,
    rate: float,
    rate_known: bool,
    disabled: bool = False,
) -> ModeState:
    """State after one sample.

    Args:
        dt: time since the last sample [s].
        inputs_ok: all inputs are numbers.
        sun_valid: cells see the Sun in this cycle.
        in_shadow: the estimator reports eclipse.
        pointing_error: array normal to estimated Sun [rad]; negative: no Sun known.
        rate: norm of the estimated body rate [rad/s].
        rate_known: there is information about it.
        disabled: of the actuators too few are left to turn the body.
    """
    sunless_time = 0.0 if sun_valid or in_shadow else state.sunless_time + dt
    lit_time = state.lit_time + dt if sun_valid else 0.0
    search_time = state.search_time + dt if state.mode == MODE_SUN_SEARCH else 0.0
    state = ModeState(state.mode, state.reason, state.wanted, state.wanted_count, sunless_time, lit_time, search_time)
    wanted, reason = wanted_mode(p, state, inputs_ok, in_shadow, pointing_error, rate, rate_known, disabled)
    count = 0
    mode = state.mode
    if wanted != mode:
        count = state.wanted_count + 1 if wanted == state.wanted else 1
        if count >= p.debounce:
            mode = wanted
            count = 0
    # a mode not yet taken has no say in why the present one holds
    reason = reason if wanted == mode else state.reason
    return ModeState(mode, reason, wanted, count, sunless_time, lit_time, search_time)


@kernel
def search_rate(p: ModeParameters, search_time: float) -> Vec3:
    """Body rate [rad/s] of the search script: a turn about x, one about y, an equal rest, again."""
    phase = int(search_time / p.search_phase_time) % _SEARCH_PHASES
    return (p.search_rate if phase == 0 else 0.0, p.search_rate if phase == 1 else 0.0, 0.0)
