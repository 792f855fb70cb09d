# SPDX-License-Identifier: Apache-2.0
"""Passages of the Sun through the slits of one head, gathered pulse by pulse, and what makes a passage unusable.

A passage holds one pulse of each slit within half a turn; between passages the Sun is behind the payload. Every
pulse or passage that is refused has its reason.
"""

from collections.abc import Callable
from typing import NamedTuple

from css_common.declared import computed, given
from css_common.kernel import kernel
from css_common.schema import Parameter, Values, integer, real
from css_sensors.slits import LOWER, UPPER, VERTICAL, timer_frequency

LOWEST_SPIN = real(
    "lowest_spin_hz", 0.2, "Hz", "slowest spin: a longer time between upper pulses is no turn", low=0.001
)
HIGHEST_SPIN = real(
    "highest_spin_hz", 20.0, "Hz", "fastest spin: a shorter time between upper pulses is no turn", low=0.002
)

# The numbers of css_msgs/SlitSunAngle.
REASON_NONE = 0
REASON_DOUBLE = 1
REASON_MISSED = 2
REASON_NO_TURN = 3
REASON_TURN_RANGE = 4
REASON_TURN_CHANGE = 5
REASON_COUNT = 6
REASON_ORDER = 7
REASON_TIMER = 8
REASON_UNKNOWN = 9

REASONS = (
    "accepted",
    "second pulse of one slit",
    "a slit gave no pulse",
    "no upper pulse one turn before",
    "RCOUNT out of range",
    "RCOUNT changed too much",
    "COUNT above half of RCOUNT",
    "vertical pulse not between the slanted ones",
    "timer went back",
    "no such slit",
)
"""What each reason says."""

_NONE = -1
# Of a turn: beyond this the Sun cannot come from one slit of a passage to the next one seen.
_GAP = 0.45
# Of a turn: near the equator the pulses fall together, and motion of the axis may swap them.
_DISORDER = 0.02


def _turn_of(spin: Parameter[float]) -> Callable[[Values], int]:
    """Length [counts] of a turn at a spin."""
    return lambda values: int(timer_frequency(values) / values[spin])


class PassageParameters(NamedTuple):
    """Limits; turns in counts."""

    longest_turn: int = computed(_turn_of(LOWEST_SPIN), LOWEST_SPIN)
    shortest_turn: int = computed(_turn_of(HIGHEST_SPIN), HIGHEST_SPIN)
    turn_change: float = given(
        real(
            "turn_change",
            0.2,
            "-",
            "largest believable change of RCOUNT from turn to turn, relative",
            low=0.001,
            high=1.0,
        )
    )
    confirmations: int = given(
        integer("confirmations", 3, "-", "turns in agreement after which a larger change is believed", low=1, high=100)
    )


class HeadState(NamedTuple):
    """One head between pulses; counts of a timer that does not wrap, -1 for none."""

    upper: int
    vertical: int
    lower: int
    last: int  # newest pulse
    previous_upper: int  # that of the passage before
    turn: int  # last believed RCOUNT
    candidate: int  # RCOUNT that differs too much from it
    agreeing: int  # turns in a row that agree with the candidate
    measured: bool  # the passage under way has been used


class Passage(NamedTuple):
    """What a pulse brought: a reason for a refusal, or a measurement when `measured`."""

    measured: bool
    reason: int
    interval: int  # COUNT, signed
    turn: int  # RCOUNT
    upper: int  # count at the upper pulse
    vertical: int  # count at the vertical pulse


def initial_state() -> HeadState:
    """No pulse yet."""
    return HeadState(_NONE, _NONE, _NONE, _NONE, _NONE, _NONE, _NONE, 0, False)


@kernel
def _refused(reason: int) -> Passage:
    return Passage(False, reason, 0, 0, 0, 0)


@kernel
def _differs(p: PassageParameters, turn: int, other: int) -> bool:
    return abs(turn - other) > p.turn_change * other


@kernel
def _first_turn(p: PassageParameters, s: HeadState, slit: int, count: int) -> tuple[HeadState, Passage]:
    """Until two upper pulses are a turn apart, nothing tells passages from each other."""
    if slit != UPPER:
        waiting = HeadState(_NONE, _NONE, _NONE, count, s.previous_upper, _NONE, _NONE, 0, False)
        return waiting, _refused(REASON_NO_TURN)
    turn = count - s.previous_upper
    if s.previous_upper == _NONE or turn > p.longest_turn:
        return (
            HeadState(_NONE, _NONE, _NONE, count, count, _NONE, _NONE, 0, False),
            _refused(REASON_NO_TURN if s.previous_upper == _NONE else REASON_TURN_RANGE),
        )
    if turn < p.shortest_turn:
        return s, _refused(REASON_DOUBLE)
    return HeadState(count, _NONE, _NONE, count, s.previous_upper, turn, _NONE, 0, False), _refused(REASON_NONE)


@kernel
def _begun_anew(slit: int, count: int) -> HeadState:
    """The state when the timer began anew with this pulse."""
    upper = count if slit == UPPER else _NONE
    return HeadState(_NONE, _NONE, _NONE, count, upper, _NONE, _NONE, 0, False)


@kernel
def take_pulse(p: PassageParameters, s: HeadState, slit: int, count: int) -> tuple[HeadState, Passage]:
    """One pulse of a head.

    Args:
        slit: UPPER, VERTICAL or LOWER.
        count: of a timer that does not wrap; pulses may come a little out of order.

    Returns:
        The new state, and the measurement or the refusal that the pulse brought.
    """
    if slit < UPPER or slit > LOWER:
        return s, _refused(REASON_UNKNOWN)
    if s.turn == _NONE:
        return _first_turn(p, s, slit, count)
    reason = REASON_NONE
    if s.last != _NONE and s.last - count > s.turn:
        return _begun_anew(slit, count), _refused(REASON_TIMER)
    upper, vertical, lower, measured = s.upper, s.vertical, s.lower, s.measured
    previous_upper = s.previous_upper
    if s.last != _NONE and count - s.last > _GAP * s.turn:
        if not measured and (upper == _NONE or vertical == _NONE or lower == _NONE):
            reason = REASON_MISSED
        previous_upper = upper
        upper = vertical = lower = _NONE
        measured = False
    again = False
    if slit == UPPER:
        again = upper != _NONE
        upper = upper if again else count
    elif slit == VERTICAL:
        again = vertical != _NONE
        vertical = vertical if again else count
    else:
        again = lower != _NONE
        lower = lower if again else count
    last = max(s.last, count)
    gathered = HeadState(upper, vertical, lower, last, previous_upper, s.turn, s.candidate, s.agreeing, measured)
    if again:
        return gathered, _refused(REASON_DOUBLE)
    if upper == _NONE or vertical == _NONE or lower == _NONE:
        return gathered, _refused(reason)
    return _evaluated(p, gathered)


@kernel
def _evaluated(p: PassageParameters, s: HeadState) -> tuple[HeadState, Passage]:
    """A passage with all its pulses."""
    turn, candidate, agreeing = s.turn, _NONE, 0
    if s.previous_upper == _NONE:
        reason = REASON_NO_TURN
    else:
        given = s.upper - s.previous_upper
        reason = REASON_NONE
        if given < p.shortest_turn or given > p.longest_turn:
            reason = REASON_TURN_RANGE
        elif _differs(p, given, s.turn):
            sustained = s.candidate != _NONE and not _differs(p, given, s.candidate)
            candidate, agreeing = given, s.agreeing + 1 if sustained else 1
            if agreeing < p.confirmations:
                reason = REASON_TURN_CHANGE
            else:
                turn, candidate, agreeing = given, _NONE, 0
        else:
            turn = given
    interval = s.lower - s.upper
    if reason == REASON_NONE:
        tolerance = _DISORDER * turn
        if 2 * abs(interval) > turn:
            reason = REASON_COUNT
        elif not min(s.upper, s.lower) - tolerance <= s.vertical <= max(s.upper, s.lower) + tolerance:
            reason = REASON_ORDER
    state = HeadState(s.upper, s.vertical, s.lower, s.last, s.previous_upper, turn, candidate, agreeing, True)
    if reason != REASON_NONE:
        return state, _refused(reason)
    return state, Passage(True, REASON_NONE, interval, turn, s.upper, s.vertical)
