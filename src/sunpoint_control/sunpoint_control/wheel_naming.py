# SPDX-License-Identifier: Apache-2.0
"""What a wheel that does not as it is commanded does instead, and what a tachometer that errs shows.

The change h of momentum that the tachometer reports in a control cycle is put on a line over the commanded u dt, h =
c u dt + b, by least squares over the cycles that contradict, or those of a trial.
"""

import math
from typing import NamedTuple

from css_common.health import (
    KIND_DEAD,
    KIND_DRIFTING,
    KIND_FRICTION,
    KIND_FROZEN,
    KIND_INTERMITTENT,
    KIND_NOISY,
    KIND_SCALED,
    KIND_SIGN,
    KIND_STUCK,
    KIND_UNKNOWN,
)
from css_common.kernel import kernel

_MOST_GAIN = 4.0
_SURE = 3.0  # [-] deviations of a slope or of a rest
_LEAST_SPREAD = 0.02  # of commands, relative to their square, that shows a slope


class Line(NamedTuple):
    """What the sums over cycles of a TRACK say."""

    known: bool  # commands have differed enough
    gain: float  # c
    deviation: float  # 1 sigma of c
    constant: float  # b [N m s]
    rough: bool  # the points lie beside the line by more than noise


@kernel
def line_of(t, noise: float) -> Line:
    """Line through the cycles of a TRACK; `noise`: 1 sigma of a reported momentum [N m s]."""
    variance = 2.0 * noise * noise
    n = t.count
    if n < 4 or t.suu <= variance:
        return Line(False, 0.0, math.inf, 0.0, False)
    spread = t.suu - t.su * t.su / n
    if spread < _LEAST_SPREAD * t.suu or spread < 4.0 * variance:
        # commands that are all alike show a gain if a wheel has no torque of its own
        c = t.suh / t.suu
        rest = max(t.shh - c * t.suh, 0.0) / n
        return Line(False, c, math.sqrt(rest / t.suu), 0.0, rest > _SURE * _SURE * variance)
    c = (t.suh - t.su * t.sh / n) / spread
    rest = max(t.shh - t.sh * t.sh / n - c * c * spread, 0.0) / n
    deviation = math.sqrt(rest * n / (n - 2) / spread)
    return Line(True, c, deviation, (t.sh - c * t.su) / n, rest > _SURE * _SURE * variance)


@kernel
def kind_of_wheel(line: Line, constant: float, share: float, speed: float) -> int:
    """KIND_* of a wheel, KIND_UNKNOWN for one that none fits, -1 for one that does what it is commanded.

    Args:
        constant: b [N m s] below which it is none.
        share: relative error of a torque that is ordinary.
        speed: of the wheel [rad/s], for the sign of its friction.
    """
    c, width = line.gain, share + _SURE * line.deviation
    pushed = abs(line.constant) > constant
    if not line.known:
        if line.rough:
            return KIND_UNKNOWN
        if abs(c) < share:
            return KIND_DEAD
        return KIND_SIGN if abs(c + 1.0) < share else KIND_UNKNOWN
    if line.rough:
        return KIND_NOISY if abs(c - 1.0) < 0.5 else KIND_INTERMITTENT
    if abs(c) < width:
        return KIND_STUCK if pushed else KIND_DEAD
    if abs(c - 1.0) < width:
        if not pushed:
            return -1
        return KIND_FRICTION if line.constant * speed < 0.0 else KIND_UNKNOWN
    if pushed:
        return KIND_FRICTION if 0.0 < c < 1.0 and line.constant * speed < 0.0 else KIND_UNKNOWN
    return KIND_SIGN if abs(c + 1.0) < width else KIND_SCALED


@kernel
def kind_of_tachometer(t, line: Line, share: float) -> int:
    """KIND_* of the tachometer of a TRACK that contradicts what wheel and body do."""
    if t.same >= t.steps:
        if t.speed == 0.0:
            return KIND_DEAD
        return KIND_STUCK if t.offset != 0.0 else KIND_FROZEN
    if abs(line.gain + 1.0) < share + _SURE * line.deviation:
        return KIND_SIGN
    # turning without having been commanded anything like it
    if abs(line.gain - 1.0) < share + _SURE * line.deviation or not -1.0 <= line.gain <= _MOST_GAIN:
        return KIND_DRIFTING
    return KIND_SCALED
