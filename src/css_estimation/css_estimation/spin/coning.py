# SPDX-License-Identifier: Apache-2.0
"""Coning of a spinning body from its passages through the slits: angle, period, all aliases and the choice of one.

A candidate is chosen, in this order: because it is the only one; because it implies the ratio of moments of inertia
that is given and no other comes near it; because its torque-free motion explains the pulses and no other's does; by
what is left, the nearer ratio or the larger power, which is no proof: the others stay its rivals.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from css_estimation.spin.coning_angle import Sine, fit_sine, max_min_angle
from css_estimation.spin.coning_motion import MotionFit, Pulses, fit_motion
from css_estimation.spin.coning_spectrum import LEAST_SAMPLES, Candidate, candidates

# The numbers of css_msgs/ConingEstimate.
CHOICE_NONE = 0
CHOICE_ONLY = 1
CHOICE_INERTIA = 2
CHOICE_EVENTS = 3
CHOICE_POWER = 4

SEGMENT = 15.0
"""Length of the windows [s] to which motions are fitted: so short that a slow drift is none."""

_CLEARLY_BETTER = 0.5  # residual, or distance from the given ratio, over that of the next candidate


class Passages(NamedTuple):
    """M passages that were accepted, in the order of time."""

    time: np.ndarray  # (M,) [s] of the vertical pulse
    angle: np.ndarray  # (M,) [rad] Sun angle
    rate: np.ndarray  # (M,) [rad/s] over the last turn
    upper: np.ndarray  # (M,) [s] of the upper pulse less the vertical one
    lower: np.ndarray  # (M,) [s] of the lower pulse less the vertical one
    azimuth: np.ndarray  # (M,) [rad] of the head

    def between(self, start: float, end: float) -> "Passages":
        """Those with start <= time < end [s]."""
        first, last = np.searchsorted(self.time, (start, end))
        return Passages(*(column[first:last] for column in self))

    def pulses(self, inclination: float) -> Pulses:
        """Their pulses, for slanted slits at an inclination [rad]."""
        tangent = np.tan(inclination)
        time = np.stack((self.time + self.upper, self.time, self.time + self.lower), 1)
        tangents = np.broadcast_to([tangent, 0.0, -tangent], time.shape)
        return Pulses(time.ravel(), tangents.ravel(), np.repeat(self.azimuth, 3))


class Coning(NamedTuple):
    """Result for one window."""

    candidates: tuple[Candidate, ...]
    residuals: tuple[float, ...]  # [s] of the motion of each candidate; -1: not fitted
    chosen: int
    choice: int
    rivals: tuple[int, ...]  # candidates that the choice does not exclude
    max_min_angle: float  # [rad] full angle, as the paper has it
    sampled_angle: float  # [rad] what the paper's method makes of `sine` at the same times
    sine: Sine  # of the chosen candidate
    motion: MotionFit | None  # of the chosen candidate: means over the segments of the window
    spin: float  # [Hz]
    sun_angle: float  # [rad] mean
    start: float  # [s] first and last passage
    end: float
    samples: int

    @property
    def full_angle(self) -> float:
        """Full coning angle [rad] of the motion; that of the sinusoid when no motion was fitted."""
        return self.sine.full_angle if self.motion is None else 2.0 * self.motion.half_angle

    @property
    def frequency(self) -> float:
        """Coning frequency [Hz] of the chosen candidate."""
        return self.candidates[self.chosen].frequency

    @property
    def resolution(self) -> float:
        """By how much the length of the window blurs the period [s]."""
        return 1.0 / (self.frequency**2 * (self.end - self.start))


def analyse_coning(passages: Passages, inclination: float, inertia_ratio: float = 0.0) -> Coning | None:
    """Coning in one window of steady motion.

    Args:
        passages: of the window.
        inclination: [rad] of the slanted slits.
        inertia_ratio: axial over transverse moment of inertia; 0: unknown.

    Returns:
        The result, or None with too few passages for one.
    """
    if len(passages.time) < LEAST_SAMPLES or passages.time[-1] <= passages.time[0]:
        return None
    time, angle = passages.time, passages.angle
    spin = 1.0 / float(np.mean(2.0 * np.pi / passages.rate))  # the mean of turns, not of rates
    largest = max_min_angle(angle)
    found = candidates(time, angle, spin, 0.5 * largest)
    if not found:
        return None
    middle = 0.5 * (time[0] + time[-1])
    segment = passages.between(middle - 0.5 * SEGMENT, middle + 0.5 * SEGMENT)
    fits = [_motion(segment, inclination, candidate, spin, largest) for candidate in found]
    chosen, choice, rivals = _chosen(found, fits, inertia_ratio)
    sine = fit_sine(time, angle, found[chosen].frequency)
    return Coning(
        candidates=tuple(found),
        residuals=tuple(-1.0 if fit is None else fit.residual for fit in fits),
        chosen=chosen,
        choice=choice,
        rivals=rivals,
        max_min_angle=largest,
        sampled_angle=max_min_angle(sine.at(time - time[0])),
        sine=sine,
        motion=_mean_motion(passages, inclination, found[chosen], spin, largest),
        spin=spin,
        sun_angle=float(np.mean(angle)),
        start=float(time[0]),
        end=float(time[-1]),
        samples=len(time),
    )


def justification(coning: Coning) -> str:
    """Why the chosen candidate was chosen, in a sentence."""
    chosen = coning.candidates[coning.chosen]
    ratios = ", ".join(f"{c.inertia_ratio:.3f}" for c in coning.candidates)
    residual = coning.residuals[coning.chosen]
    others = [r for i, r in enumerate(coning.residuals) if i != coning.chosen and r >= 0.0]
    fitted = ""
    if residual >= 0.0 and others:
        fitted = (
            f"; its motion misses the pulses by {1e6 * residual:.3g} us, "
            f"the others' by {1e6 * min(others):.3g} us or more"
        )
    if coning.choice == CHOICE_ONLY:
        return f"the only frequency that a rigid body can have{fitted}"
    if coning.rivals:
        return f"{_ambiguity(coning)} (ratios of all candidates: {ratios}){fitted}"
    if coning.choice == CHOICE_INERTIA:
        return (
            f"implies a ratio of moments of inertia of {chosen.inertia_ratio:.3f}, nearest to the given one "
            f"(all: {ratios}){fitted}"
        )
    return f"its torque-free motion explains the pulses{fitted}"


def _ambiguity(coning: Coning) -> str:
    """That others are as good as what was chosen, which they are, and what would help."""
    periods = ", ".join(f"{1.0 / coning.candidates[i].frequency:.4f} s" for i in coning.rivals)
    if coning.choice == CHOICE_INERTIA:
        return f"ambiguous, {periods} may as well be: the given ratio of moments of inertia lies between theirs"
    return f"ambiguous, {periods} may as well be: the largest power is no proof; give the ratio of moments of inertia"


def _chosen(
    found: list[Candidate], fits: list[MotionFit | None], inertia_ratio: float
) -> tuple[int, int, tuple[int, ...]]:
    """Number of the candidate, why, and its rivals."""
    if len(found) == 1:
        return 0, CHOICE_ONLY, ()
    left = list(range(len(found)))
    best, choice = max(left, key=lambda i: found[i].power), CHOICE_POWER
    if inertia_ratio > 0.0:
        distance = [abs(candidate.inertia_ratio - inertia_ratio) for candidate in found]
        best, choice = min(left, key=distance.__getitem__), CHOICE_INERTIA
        left = [i for i in left if distance[best] >= _CLEARLY_BETTER * distance[i]]
    fitted = sorted((fit.residual, i) for i in left if (fit := fits[i]) is not None)
    if len(left) > 1 and len(fitted) > 1 and fitted[0][0] < _CLEARLY_BETTER * fitted[1][0]:
        return fitted[0][1], CHOICE_EVENTS, ()
    return best, choice, tuple(i for i in left if i != best)


def _motion(
    passages: Passages, inclination: float, candidate: Candidate, spin: float, full_angle: float
) -> MotionFit | None:
    if not len(passages.time):
        return None
    sun_angle = float(np.mean(passages.angle))
    return fit_motion(passages.pulses(inclination), candidate.frequency, spin, sun_angle, 0.5 * full_angle)


def _mean_motion(
    passages: Passages, inclination: float, candidate: Candidate, spin: float, full_angle: float
) -> MotionFit | None:
    """Mean over equal segments of the window."""
    start, end = passages.time[0], passages.time[-1]
    edges = np.linspace(start, np.nextafter(end, np.inf), max(1, round((end - start) / SEGMENT)) + 1)
    fits = [_motion(passages.between(a, b), inclination, candidate, spin, full_angle) for a, b in pairwise(edges)]
    rows = np.array([fit for fit in fits if fit is not None])
    if not len(rows):
        return None
    half_angle, coning, turns, sun_polar, _ = np.mean(rows, axis=0).tolist()
    return MotionFit(half_angle, coning, turns, sun_polar, float(np.sqrt(np.mean(rows[:, -1] ** 2))))
