# SPDX-License-Identifier: Apache-2.0
"""Outputs that fade together are a Sun that sets, not a body that turns.

A penumbra in low orbit is over in 8 s. An estimator that takes what is left of the light for a direction, or two such
directions for a rate, ends in the dark with an error that nothing corrects for half an hour. What all cells in the Sun
have in common is their light: the factor between their outputs and the cosines of the heading, here the largest of all
cells. A turn does not change it, but for the curve of the cells and the Earth, and that slowly; a Sun that sets takes a
tenth of it in a second or two. From there on the heading is held, until the light is back, gone, or lasts.

A flight that goes by its orbit model (`eclipse.source: model`) asks that instead.
"""

from typing import NamedTuple

from css_common.kernel import kernel
from css_common.vectors import Vec3
from css_estimation.sun.cell_layout import READABLE, CellLayout, cosine_on, sees

# What is left of the light of the last seconds when it fades: a filter knows from its prediction what a turn changes,
# a heading of one cycle alone does not.
KNOWN_TURN, UNKNOWN_TURN = 0.9, 0.75
# [s] that the light is averaged over; for how long before it can fade, so that a rising Sun and a heading's convergence
# are over; and after which light that has faded, but not gone, is another intensity.
_MEMORY, _SETTLED, _LASTING = 5.0, 10.0, 15.0
# What is left of the light after a step that is none of a Sun that sets: a cell has lost it, or the heading was wrong.
_LEAP = 0.65
# Part of the largest cosine that a cell needs to count.
_FACING = 0.5
# Variance of a heading, both axes [rad^2], above which its cosines tell no light: 7 deg about each axis.
_SURE = 0.03


class LightTrack(NamedTuple):
    """Carried from cycle to cycle."""

    light: float  # [-] of the last seconds; 0: none yet
    before: float  # [-] that from which it has faded; 0: it has not
    time: float  # [s] since then; if it has not, for how long it has been followed


class LightNow(NamedTuple):
    """What an estimator can tell of the light in a cycle."""

    light: float  # [-] 0: it cannot tell
    share: float  # of the light of the last seconds, below which it fades


def initial_track() -> LightTrack:
    """No light yet."""
    return LightTrack(0.0, 0.0, 0.0)


@kernel
def tells_light(track: LightTrack, variance: float) -> bool:
    """Whether a heading with so much variance about its two axes together [rad^2] tells the light on the cells.

    While it fades the heading is held, and its variance grows by what is not known of the motion.
    """
    return variance < _SURE or (track.before > 0.0 and track.light > 0.0)


@kernel
def cells_that_see(layout: CellLayout, direction_b: Vec3) -> int:
    """Mask of the cells in whose view a unit vector is."""
    mask = 0
    for i in range(layout.cells.shape[0]):
        if sees(layout, i, direction_b):
            mask |= 1 << i
    return mask


@kernel
def light_on(layout: CellLayout, direction_b: Vec3, voltages, mask: int) -> float:
    """Largest output of the cells in `mask` relative to its cosine with a unit vector; 0 without any.

    The largest, so that it fades when all do; of cells that do not face the direction least of all.
    """
    facing = 0.0
    for i in range(voltages.shape[0]):
        if mask >> i & 1:
            facing = max(facing, cosine_on(layout, i, direction_b))
    light = 0.0
    for i in range(voltages.shape[0]):
        if mask >> i & 1 and -READABLE < voltages[i] < READABLE:
            cosine = cosine_on(layout, i, direction_b)
            if cosine >= _FACING * facing and cosine > 0.0:
                light = max(light, voltages[i] / cosine)
    return light


@kernel
def follow_light(track: LightTrack, dt: float, now: LightNow) -> tuple[LightTrack, bool]:
    """The track after `dt` [s] with light on the cells, and whether it fades."""
    if not now.light > 0.0:
        return LightTrack(0.0, 0.0, 0.0), False
    if track.before > 0.0 and track.light > 0.0:
        if now.light < now.share * track.before and track.time + dt < _LASTING:
            return LightTrack(now.light, track.before, track.time + dt), True
        return LightTrack(now.light, 0.0, _SETTLED), False
    leaps = now.light < _LEAP * track.light
    if not track.light > 0.0 or leaps:
        return LightTrack(now.light, 0.0, track.time if leaps else 0.0), False
    if now.light < now.share * track.light and track.time >= _SETTLED:
        return LightTrack(now.light, track.light, 0.0), True
    gain = min(1.0, dt / _MEMORY)
    return LightTrack(track.light + gain * (now.light - track.light), 0.0, min(track.time + dt, _SETTLED)), False


@kernel
def in_the_dark(track: LightTrack, rate_measured: bool) -> LightTrack:
    """The track of a cycle without light: what has faded is gone, the next light is a new one.

    That it has faded is remembered for what it made of the rate, until a rate is measured.
    """
    return LightTrack(0.0, 0.0 if rate_measured else track.before, 0.0)
