# SPDX-License-Identifier: Apache-2.0
"""The Sun line as a reference for the gyro: blocks of cycles, and how well the sight knows them.

The error of a sight by cells is hardly noise. What the Earth throws on a cell and what a cell reads amiss stays as long
as the body does; it wanders as the body turns, and as clouds pass. Within a block of time T at a rate w it walks by
2 sigma^2 (1 / time + w / angle) T, the beginning of an Ornstein-Uhlenbeck process, which is what a block is worth.
White noise is measured in flight: how the sight jitters from cycle to cycle about the way that the gyro gives it.
What the body may have turned between two samples of the gyro, and no rate tells, comes on top (`unknown_turn`); a step
so long that this may be anything ends the block. Where the sight jumps, as when a cell comes into view, by more than
noise and any error of the gyro can make it within a cycle, the block is given up too.
"""

import math
from typing import NamedTuple

from css_common.conversions import square_of_degrees
from css_common.declared import given, made, table_of
from css_common.kernel import kernel
from css_common.schema import real
from css_common.vectors import Mat3, Vec3, add, axes_across, cross, dot, scale, subtract
from css_estimation.health.gyroless_sight import Glimpse
from css_estimation.health.rate_checks import LARGEST_UNKNOWN
from css_estimation.health.reference_line import NO_LINE, Line, begin_line, carry
from css_estimation.symmetric import Symmetric, product

_SHARE = 1.0 / 20.0  # of a new cycle in the measured jitter
_SIGMAS = 6.0  # beyond which a change is a jump
_LONGEST_WITHOUT = 2.0  # [s] without sight that a block lives through
# [rad^2] 2.5 deg: a larger variance is that of a direction which the cells of now do not tell; it is not a lasting
# error, but will be gone with the next cell that sees the Sun
_TOLD = math.radians(2.5) ** 2


class SightLineParameters(NamedTuple):
    """How the error of a sight behaves."""

    floor: float = made(  # [rad2]
        square_of_degrees,
        real(
            "health.sight.error_deg",
            1.5,
            "deg",
            "lasting error of the sight by cells that tell the direction, per axis, 1 sigma",
            low=0.0,
            high=45.0,
        ),
    )
    time: float = given(real("health.sight.time", 70.0, "s", "correlation time of its error", low=1.0, high=1e6))
    settling: float = given(
        real("health.sight.settling", 5.0, "s", "after a Sun is found, until it is used", low=0.0, high=1e4)
    )
    angle: float = made(
        math.radians,
        real("health.sight.angle_deg", 50.0, "deg", "turn of the body after which it is another", low=1.0, high=1e6),
    )


PARAMETERS = table_of(SightLineParameters)


class SightLine(NamedTuple):
    """A block under way, and the white noise of the sight."""

    line: Line
    covariance: Symmetric  # [rad2] of the sight that it began with
    behind_b: Vec3  # [rad] what the sight was off the carried line when it was last seen
    jitter: float  # [rad2] along the axis that is known best; -1: not measured yet
    unknown: float  # [rad2] of the turn since it began, per axis, that no rate tells
    unseen: float  # [s] since there was a sight
    seen: float  # [s] since it was found


_UNKNOWN = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
NO_SIGHT_LINE = SightLine(NO_LINE, _UNKNOWN, (0.0, 0.0, 0.0), -1.0, 0.0, 0.0, 0.0)


@kernel
def interrupted(state: SightLine) -> SightLine:
    """The block is given up; what is known of the sight stays."""
    return SightLine(NO_LINE, _UNKNOWN, (0.0, 0.0, 0.0), state.jitter, 0.0, state.unseen, state.seen)


@kernel
def begin_again(state: SightLine, sight: Glimpse, bias_b: Vec3) -> SightLine:
    """The next block, which begins with this sight.

    Args:
        bias_b: of the gyro, as far as it is known [rad/s].
    """
    return SightLine(
        begin_line(sight.sun_b, bias_b), sight.covariance, (0.0, 0.0, 0.0), state.jitter, 0.0, 0.0, state.seen
    )


@kernel
def across(direction: Vec3, v: Vec3) -> Vec3:
    """Part of a vector across a unit vector."""
    return subtract(v, scale(dot(v, direction), direction))


@kernel
def follow_sight(
    p: SightLineParameters,
    state: SightLine,
    dt: float,
    rate_b: Vec3,
    bias_b: Vec3,
    largest_error: float,
    unknown: float,
    sight: Glimpse,
) -> tuple[SightLine, Vec3]:
    """One cycle: the block, and what the sight is off the line that the gyro has carried [rad].

    A block that is given up begins again with this sight.

    Args:
        dt: [s] from the sight of the last cycle to this one.
        rate_b: of the gyro in this time [rad/s].
        bias_b: its bias, as far as it is known [rad/s].
        largest_error: of a gyro [rad/s].
        unknown: of the turn in this time, as of `unknown_turn` [rad^2].
    """
    if unknown > LARGEST_UNKNOWN:
        return SightLine(NO_LINE, _UNKNOWN, (0.0, 0.0, 0.0), state.jitter, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    line, total = carry(state.line, rate_b, dt), state.unknown + unknown
    if not sight.known:
        unseen = state.unseen + dt
        if unseen > _LONGEST_WITHOUT:
            return SightLine(NO_LINE, _UNKNOWN, (0.0, 0.0, 0.0), state.jitter, 0.0, unseen, 0.0), (0.0, 0.0, 0.0)
        after = SightLine(line, state.covariance, state.behind_b, state.jitter, total, unseen, state.seen)
        return after, (0.0, 0.0, 0.0)
    if not line.begun:
        seen_for = state.seen + dt
        if seen_for < p.settling:
            return SightLine(NO_LINE, _UNKNOWN, (0.0, 0.0, 0.0), state.jitter, 0.0, 0.0, seen_for), (0.0, 0.0, 0.0)
        return begin_again(state, sight, bias_b), (0.0, 0.0, 0.0)
    behind_b = across(sight.sun_b, subtract(sight.sun_b, line.vector_b))
    jitter = state.jitter
    change = subtract(behind_b, state.behind_b)
    (_, best, _), _ = axes_of(state.covariance, sight)
    told = dot(best, product(sight.covariance, best))
    noise = told if jitter < 0.0 else jitter
    wrong = largest_error * (state.unseen + dt)
    if dot(change, change) > wrong * wrong + _SIGMAS * _SIGMAS * (2.0 * noise + unknown):
        return begin_again(state, sight, bias_b), (0.0, 0.0, 0.0)
    # the difference of two samples; none is taken for noisier than the sight says
    seen = min(0.5 * dot(change, best) * dot(change, best), told)
    jitter = seen if jitter < 0.0 else jitter + _SHARE * (seen - jitter)
    return SightLine(line, state.covariance, behind_b, jitter, total, 0.0, state.seen), behind_b


@kernel
def axes_of(before: Symmetric, sight: Glimpse) -> tuple[Mat3, Vec3]:
    """Axes across the Sun line (worse, better, along) of what two sights do not know, and variances along them [rad^2].

    Args:
        before: covariance of the earlier one, in b.
        sight: the later.
    """
    now = sight.covariance
    total = (
        before[0] + now[0],
        before[1] + now[1],
        before[2] + now[2],
        before[3] + now[3],
        before[4] + now[4],
        before[5] + now[5],
    )
    e1, e2 = axes_across(sight.sun_b)
    a, b, c = dot(e1, product(total, e1)), dot(e1, product(total, e2)), dot(e2, product(total, e2))
    angle = 0.5 * math.atan2(2.0 * b, a - c)
    worse = add(scale(math.cos(angle), e1), scale(math.sin(angle), e2))
    better = cross(sight.sun_b, worse)
    variances = (dot(worse, product(total, worse)), dot(better, product(total, better)), 0.0)
    return (worse, better, sight.sun_b), variances


@kernel
def whitening(p: SightLineParameters, state: SightLine, sight: Glimpse, dt: float, rate_noise: float) -> Mat3:
    """What turns the difference at the end of a block [rad] into two numbers of variance one, for a good gyro.

    Args:
        rate_noise: variance of a sample of the gyro [rad2/s2].
    """
    line = state.line
    (worse, better, _), (larger, smaller, _) = axes_of(state.covariance, sight)
    wandered = 2.0 * p.floor * min(line.time / p.time + line.turn / p.angle, 1.0)
    usual = wandered + 2.0 * max(state.jitter, 0.0) + rate_noise * dt * line.time + state.unknown
    return (
        scale(1.0 / math.sqrt(usual + max(larger - 2.0 * _TOLD, 0.0)), worse),
        scale(1.0 / math.sqrt(usual + max(smaller - 2.0 * _TOLD, 0.0)), better),
        (0.0, 0.0, 0.0),
    )
