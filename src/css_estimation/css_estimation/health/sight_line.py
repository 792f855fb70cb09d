# SPDX-License-Identifier: Apache-2.0
"""The Sun line as a reference for the gyro: blocks of cycles, and how well the sight knows them.

The error of a sight by cells is hardly noise. What the Earth throws on a cell and what a cell reads amiss stays as long
as the body does; it wanders as the body turns, and as clouds pass. Within a block of time T at a rate w it walks by
2 sigma^2 (1 / time + w / angle) T, the beginning of an Ornstein-Uhlenbeck process, which is what a block is worth.
White noise is measured in flight: how the sight jitters from cycle to cycle about the way that the gyro gives it.
Where it jumps, as when a cell comes into view, by more than noise and any error of the gyro can make it within a cycle,
the block is given up.
"""

import math
from typing import NamedTuple

from css_common.conversions import square_of_degrees
from css_common.declared import given, made, table_of
from css_common.kernel import kernel
from css_common.schema import real
from css_common.vectors import Vec3, dot, scale, subtract
from css_estimation.health.reference_line import NO_LINE, Line, begin_line, carry
from css_estimation.health.sight import Sight

_SHARE = 1.0 / 20.0  # of a new cycle in the measured jitter
_SIGMAS = 6.0  # beyond which a change is a jump
_LONGEST_WITHOUT = 2.0  # [s] without sight that a block lives through


class SightLineParameters(NamedTuple):
    """How the error of a sight behaves."""

    floor: float = made(  # [rad2]
        square_of_degrees,
        real(
            "health.sight.error_deg",
            1.5,
            "deg",
            "least lasting error of the sight, whatever it says of itself, per axis, 1 sigma",
            low=0.0,
            high=45.0,
        ),
    )
    time: float = given(real("health.sight.time", 70.0, "s", "correlation time of its error", low=1.0, high=1e6))
    angle: float = made(
        math.radians,
        real("health.sight.angle_deg", 50.0, "deg", "turn of the body after which it is another", low=1.0, high=1e6),
    )


PARAMETERS = table_of(SightLineParameters)


class SightLine(NamedTuple):
    """A block under way, and the white noise of the sight."""

    line: Line
    behind_b: Vec3  # [rad] what the sight was off the carried line when it was last seen
    jitter: float  # [rad2] per axis; -1: not measured yet
    unseen: float  # [s] since there was a sight


NO_SIGHT_LINE = SightLine(NO_LINE, (0.0, 0.0, 0.0), -1.0, 0.0)


@kernel
def interrupted(state: SightLine) -> SightLine:
    """The block is given up; what is known of the noise stays."""
    return SightLine(NO_LINE, (0.0, 0.0, 0.0), state.jitter, 0.0)


@kernel
def begin_again(state: SightLine, sight: Sight, bias_b: Vec3) -> SightLine:
    """The next block, which begins with this sight.

    Args:
        bias_b: of the gyro, as far as it is known [rad/s].
    """
    return SightLine(begin_line(sight.sun_b, bias_b), (0.0, 0.0, 0.0), state.jitter, 0.0)


@kernel
def across(direction: Vec3, v: Vec3) -> Vec3:
    """Part of a vector across a unit vector."""
    return subtract(v, scale(dot(v, direction), direction))


@kernel
def follow_sight(
    state: SightLine, dt: float, rate_b: Vec3, bias_b: Vec3, largest_error: float, sight: Sight
) -> tuple[SightLine, Vec3]:
    """One cycle: the block, and what the sight is off the line that the gyro has carried [rad].

    A block that is given up begins again with this sight.

    Args:
        dt: [s] from the sight of the last cycle to this one.
        rate_b: of the gyro in this time [rad/s].
        bias_b: its bias, as far as it is known [rad/s].
        largest_error: of a gyro [rad/s].
    """
    line = carry(state.line, rate_b, dt)
    if not sight.known:
        unseen = state.unseen + dt
        if unseen > _LONGEST_WITHOUT:
            return interrupted(state), (0.0, 0.0, 0.0)
        return SightLine(line, state.behind_b, state.jitter, unseen), (0.0, 0.0, 0.0)
    if not line.begun:
        return begin_again(state, sight, bias_b), (0.0, 0.0, 0.0)
    behind_b = across(sight.sun_b, subtract(sight.sun_b, line.vector_b))
    jitter = state.jitter
    change = subtract(behind_b, state.behind_b)
    # two axes, each the difference of two samples; none is taken for noisier than the sight says
    moved = dot(change, change)
    noise = sight.variance if jitter < 0.0 else jitter
    wrong = largest_error * (state.unseen + dt)
    if moved > wrong * wrong + _SIGMAS * _SIGMAS * 2.0 * noise:
        return begin_again(state, sight, bias_b), (0.0, 0.0, 0.0)
    seen = min(0.25 * moved, sight.variance)
    jitter = seen if jitter < 0.0 else jitter + _SHARE * (seen - jitter)
    return SightLine(line, behind_b, jitter, 0.0), behind_b


@kernel
def block_variance(p: SightLineParameters, state: SightLine, sight: Sight, dt: float, rate_noise: float) -> float:
    """Variance [rad2] per axis of what the sight of a good gyro is off at the end of a block.

    Args:
        rate_noise: variance of a sample of the gyro [rad2/s2].
    """
    line = state.line
    lasting = max(sight.variance, p.floor)
    wandered = 2.0 * lasting * (line.time / p.time + line.turn / p.angle)
    white = sight.variance if state.jitter < 0.0 else state.jitter
    return 2.0 * white + min(wandered, 2.0 * lasting) + rate_noise * dt * line.time
