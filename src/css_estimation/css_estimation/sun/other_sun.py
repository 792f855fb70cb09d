# SPDX-License-Identifier: Apache-2.0
"""The other Sun that explains the outputs of a filter's cells as well as its estimate does.

A filter of a unit vector takes the length of what its cells show for a component that they do not show, with the sign
that the estimate happens to have, and is soon sure of it. Where the cells that inform it do not span space the mirror
image of the estimate (`left_open`) is therefore followed beside it, by a filter of its own, from the moment when the
Sun cannot have gone over from the one to the other any more, by the estimate's own covariance. Outputs decide between
the two: those of cells that surely see one of them alone, and, with a gyro, how the Sun moves. Until they have, both
are part of what is reported.
"""

import math
from typing import NamedTuple

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, add, angle_between, dot, norm, scale, subtract, unit
from css_estimation.sun.cell_layout import READABLE, CellLayout, cosine_on, half_view_of, sees, view_margin
from css_estimation.sun.left_open import Span, mirrored, span_of, surely_spans_space
from css_estimation.sun.lit_cells import Gate, lit_cells, scale_of
from css_estimation.sun.sun_heading import Covariance
from css_estimation.sun.sunline_filter import constrain, propagate, update_cells
from css_estimation.symmetric import Symmetric, add_outer, at_most, congruence, product, row_major
from css_sensors.cells import IN_PLANE

# Two standard deviations: within it a covariance covers the other Sun. Three: within it the Sun may be; odds beyond it
# are a decision.
_COVERED, _POSSIBLE = 2.0**2, 3.0**2
_DECIDED = 0.5 * 3.0**2
# [s] Outputs of cycles within it say the same once: what the model has wrong lasts.
_NEWS = 1.0
# Square of a cell's misfit [sigma] beyond which it is broken, and says no more.
_MOST = 5.0**2
_LARGEST_VARIANCE = 4.0
_NO_DIRECTION = 1e-6
_IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class OtherSun(NamedTuple):
    """Carried from cycle to cycle."""

    alive: bool  # there is one
    apart: bool  # the covariance of the estimate does not cover it
    sun_b: Vec3
    covariance: Symmetric
    odds: float  # logarithm, of the estimate against it


class Followed(NamedTuple):
    """What a filter says of a cycle, after its own update."""

    layout: CellLayout
    gate: Gate
    cell_variance: float
    sun_b: Vec3  # its estimate
    covariance: Symmetric  # of it
    informing: int  # mask of the cells that corrected it; 0 in the dark
    rate_b: Vec3  # [rad/s] measured; zeros where there is none
    process_noise: float  # [rad^2/s] of the direction at that rate
    light: float  # [-] on the cells, by which the estimate explains their outputs; 1: as calibrated


@kernel
def no_other_sun() -> OtherSun:
    """None."""
    return OtherSun(False, False, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.0)


@kernel
def _within(sun_b: Vec3, covariance: Symmetric, other_b: Vec3, limit: float) -> bool:
    """Whether a direction is within so many standard deviations of an estimate, of which `limit` is the square."""
    off = subtract(other_b, sun_b)
    squared = dot(off, off)
    return squared * squared <= limit * dot(off, product(covariance, off))


@kernel
def _image_in_reach(f: Followed, span: Span) -> tuple[bool, Vec3]:
    """Whether the Sun may have gone over to the mirror image of the estimate, and where that is.

    It has if the covariance of the estimate covers the way to the span, where the two are one.
    """
    image_b = mirrored(span, f.sun_b)
    halfway = add(f.sun_b, image_b)
    reached = (
        span.rank < 3 and norm(halfway) > _NO_DIRECTION and _within(f.sun_b, f.covariance, unit(halfway), _POSSIBLE)
    )
    return reached, image_b


@kernel
def _image(f: Followed, lit_mask: int) -> tuple[bool, bool, Vec3, Mat3]:
    """Whether lit cells leave open on which side the Sun is; whether its image is in reach, where, and the mirror."""
    cells = f.layout.cells
    leaves, found, image_b = False, False, f.sun_b
    span = Span(3, _IDENTITY, f.sun_b)
    if lit_mask != 0 and not surely_spans_space(cells, lit_mask):
        span = span_of(cells, lit_mask)
        leaves = span.rank < 3
        found, image_b = _image_in_reach(f, span)
        # a single lit cell leaves a ring, of which dark ones leave two parts
        if leaves and not found and f.informing != lit_mask and not surely_spans_space(cells, f.informing):
            span = span_of(cells, f.informing)
            found, image_b = _image_in_reach(f, span)
    x, y, z = _IDENTITY
    mirror = (mirrored(span, x), mirrored(span, y), mirrored(span, z)) if found else _IDENTITY
    return leaves, found, image_b, mirror


@kernel
def _surely_sees(layout: CellLayout, i: int, lasting: float, sun_b: Vec3, covariance: Symmetric) -> bool:
    """Whether a cell has the Sun in view, by more than the error of its direction.

    Args:
        lasting: error of a cosine beside that by the covariance, which holds what errs at random [-].
    """
    edge = half_view_of(layout, i)
    beyond = cosine_on(layout, i, sun_b) - edge
    return sees(layout, i, sun_b) and (edge <= IN_PLANE or beyond > view_margin(layout, i, covariance) + lasting)


@kernel
def _misfit(f: Followed, voltages, top: int, light: float, sun_b: Vec3, covariance: Symmetric) -> float:
    """Sum of the normalised squares of what the Sun in a direction leaves of the outputs that it has to explain.

    A dark cell that has the Sun in view is one of them unless the error of the direction can have it beyond the edge.
    """
    level = f.gate.level * scale_of(f.gate, voltages[top])
    total, lasting = 0.0, math.sqrt(f.cell_variance)
    for i in range(voltages.shape[0]):
        v = voltages[i]
        # a NaN compares false
        if -READABLE < v < READABLE and (v > level or _surely_sees(f.layout, i, lasting, sun_b, covariance)):
            left = v - light * cosine_on(f.layout, i, sun_b)
            total += min(left * left / f.cell_variance, _MOST)
    return total


@kernel
def follow_other(f: Followed, other: OtherSun, dt: float, voltages, top: int) -> tuple[OtherSun, bool]:
    """The other Sun after a cycle, and whether it is the right one: the filter then has to go on from there.

    Args:
        dt: [s] since the cycle before.
        top: result of `brightest`.
    """
    lit = f.informing != 0
    # cells that it has in view and are dark say on which side of their edge the Sun is, not where
    lit_mask = f.informing & lit_cells(f.layout, f.gate, voltages, top)[1] if lit else 0
    leaves, found, image_b, mirror = _image(f, lit_mask)
    if found:
        # as long as the Sun may go over to it, it is the image of each cycle
        apart = not _within(f.sun_b, f.covariance, image_b, _COVERED)
        return OtherSun(True, apart, image_b, congruence(mirror, f.covariance), 0.0), False
    if not other.alive:
        return no_other_sun(), False
    sun_b, covariance = propagate(other.sun_b, other.covariance, f.rate_b, dt, f.process_noise)
    predicted_b = sun_b
    if lit:
        sun_b, covariance, _, _, _ = update_cells(
            f.layout, f.gate, f.cell_variance, True, math.sqrt(f.cell_variance), sun_b, covariance, voltages, top
        )
    sun_b, covariance = constrain(sun_b, predicted_b, covariance, _LARGEST_VARIANCE)
    if _within(f.sun_b, f.covariance, sun_b, _COVERED):
        return (OtherSun(True, False, sun_b, covariance, 0.0) if leaves else no_other_sun()), False
    odds = other.odds
    if lit:
        difference = _misfit(f, voltages, top, 1.0, sun_b, covariance) - _misfit(
            f, voltages, top, f.light, f.sun_b, f.covariance
        )
        odds += 0.5 * min(1.0, dt / _NEWS) * difference
    if odds > _DECIDED:
        return no_other_sun(), False
    return OtherSun(True, True, sun_b, covariance, odds), odds < -_DECIDED


@kernel
def with_other(other: OtherSun, sun_b: Vec3, covariance: Symmetric, largest_variance: float) -> Covariance:
    """Covariance to report of an estimate: the other Sun is part of it by its odds, as far off as its angle is."""
    if not other.apart:
        return row_major(covariance)
    share = 1.0 / (1.0 + math.exp(other.odds))
    angle = angle_between(other.sun_b, sun_b)
    across = subtract(other.sun_b, scale(dot(other.sun_b, sun_b), sun_b))
    length = norm(across)
    if length > _NO_DIRECTION:
        p = add_outer(covariance, share * angle * angle / (length * length), across)
    else:
        # behind the estimate: in no direction more than in another
        p = add_outer(covariance, -0.5 * share * angle * angle, sun_b)
        d = 0.5 * share * angle * angle
        p = (p[0] + d, p[1], p[2], p[3] + d, p[4], p[5] + d)
    return row_major(at_most(p, largest_variance))
