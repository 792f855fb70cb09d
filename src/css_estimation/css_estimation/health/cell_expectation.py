# SPDX-License-Identifier: Apache-2.0
"""What a cell should read, if the Sun is where the cells together see it: an interval and its error.

Reflected light adds what no model need know, from nothing to a bound. Near the edge of its view a cell may see the Sun
or not. The error of an output is a share of it and a floor; that of the heading acts through the slope of the cosine.
"""

import math
from typing import NamedTuple

from css_common.kernel import kernel
from css_common.vectors import Vec3, dot
from css_environment.albedo import is_blocked
from css_estimation.health.cell_options import CellHealthParameters
from css_estimation.sun.cell_layout import cosine_on, half_view_of
from css_estimation.symmetric import Symmetric, product

MOST_SQUARED = 25.0
"""Bound on the squared sigmas of a single cell, so that no single look decides."""

# Variance of the Earth's light where it is a guess, by the square of its bound: that is 2.5 sigma.
_EARTH_SHARE = 0.16

SURE = 3.0
"""Sigmas of a direction that is followed within which the edge of a view is in doubt."""

HIDDEN, DOUBTFUL, SEEN = 0, 1, 2


class Expected(NamedTuple):
    """Of one cell."""

    low: float  # [-] without the Earth
    high: float
    variance: float  # [-]
    sight: int  # HIDDEN, DOUBTFUL or SEEN: whether the Sun is in its view


@kernel
def _spread(normal_b: Vec3, cosine: float, covariance: Symmetric, heading: float) -> float:
    """Variance of the cosine on a normal."""
    return max(0.0, dot(normal_b, product(covariance, normal_b))) + heading * max(0.0, 1.0 - cosine * cosine)


@kernel
def expected(
    p: CellHealthParameters, i: int, sun_b: Vec3, covariance: Symmetric, light: float, sigmas: float
) -> Expected:
    """Of cell `i` with the Sun in a unit direction.

    Args:
        covariance: of the direction [rad^2]; the lasting error of headings comes on top.
        light: output at normal incidence [-].
        sigmas: of the direction within which the edge of a view is in doubt.
    """
    cell = p.layout.cells[i]
    cosine = cosine_on(p.layout, i, sun_b)
    spread = _spread((cell.nx, cell.ny, cell.nz), cosine, covariance, p.heading)
    margin = sigmas * math.sqrt(spread)
    inside = cosine - half_view_of(p.layout, i)
    view = SEEN
    if inside < -margin:
        view = HIDDEN
    elif inside < margin:
        view = DOUBTFUL
    if cell.side != 0.0 and view != HIDDEN:
        clip = p.layout.clip_normal_b
        component = dot(clip, sun_b)
        room = sigmas * math.sqrt(_spread(clip, component, covariance, p.heading))
        above = component if cell.side > 0.0 else -component
        if above < -room:
            view = HIDDEN
        elif above < room:
            view = DOUBTFUL
    if is_blocked(p.layout.screen, i, sun_b):
        view = HIDDEN
    if view == HIDDEN:
        return Expected(0.0, 0.0, p.floor, view)
    if p.screened >> i & 1:
        view = DOUBTFUL
    high = light * max(0.0, cosine)
    low = high if view == SEEN else 0.0
    return Expected(low, high, p.floor + p.share * high * high + light * light * spread, view)


@kernel
def misfit(p: CellHealthParameters, e: Expected, output: float) -> float:
    """Squared sigmas by which an output is off, bounded, where much light of the Earth is possible but unlikely."""
    off = 0.0
    variance = e.variance
    if output > e.high:
        off = output - e.high
        variance += p.earth * p.earth * _EARTH_SHARE
    elif output < e.low:
        off = output - e.low
    return min(off * off / variance, MOST_SQUARED)


@kernel
def contradiction(p: CellHealthParameters, e: Expected, output: float, share: float) -> float:
    """Squared sigmas by which an output is outside of what is expected, with its sign, bounded.

    Args:
        share: of the light that is left on all cells.
    """
    off = 0.0
    if output > e.high + p.earth:
        off = output - e.high - p.earth
    elif output < share * e.low:
        off = output - share * e.low
    squared = min(off * off / e.variance, MOST_SQUARED)
    return squared if off > 0.0 else -squared
