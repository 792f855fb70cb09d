# SPDX-License-Identifier: Apache-2.0
"""Coning angle from Sun angles: the paper's maxima and minima, and a sinusoid by least squares."""

from typing import NamedTuple

import numpy as np


class Sine(NamedTuple):
    """SA = offset + slope t + C cos(w t) + D sin(w t), with t from the first sample."""

    offset: float  # [rad]
    slope: float  # [rad/s]
    cosine: float  # C [rad]
    sine: float  # D [rad]
    frequency: float  # [Hz]

    @property
    def full_angle(self) -> float:
        """Twice the amplitude [rad]."""
        return 2.0 * float(np.hypot(self.cosine, self.sine))

    def at(self, elapsed: np.ndarray) -> np.ndarray:
        """Values [rad] at times [s] from the first sample."""
        phase = 2.0 * np.pi * self.frequency * elapsed
        return self.offset + self.slope * elapsed + self.cosine * np.cos(phase) + self.sine * np.sin(phase)


def extremum_differences(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Differences [rad] of consecutive local maxima and minima (Reichard et al., ESPRIT, Fig. 5).

    Args:
        angle: (M,) Sun angles [rad] in the order of time.

    Returns:
        (E,) differences without sign, and (E,) index of the later extremum of each.
    """
    steps = np.sign(np.diff(angle))
    turning = np.flatnonzero(steps[1:] * steps[:-1] < 0.0) + 1
    return np.abs(np.diff(angle[turning])), turning[1:]


def max_min_angle(angle: np.ndarray) -> float:
    """Full coning angle [rad] as the paper has it: the mean of `extremum_differences`; 0 with less than two extrema."""
    differences, _ = extremum_differences(angle)
    return float(differences.mean()) if len(differences) else 0.0


def fit_sine(time: np.ndarray, angle: np.ndarray, frequency: float) -> Sine:
    """Least-squares sinusoid of a frequency [Hz], with offset and slope, through Sun angles (M,) [rad] at (M,) [s]."""
    elapsed = time - time[0]
    phase = 2.0 * np.pi * frequency * elapsed
    columns = np.stack((np.ones_like(elapsed), elapsed, np.cos(phase), np.sin(phase)), 1)
    solution, *_ = np.linalg.lstsq(columns, angle, rcond=None)
    offset, slope, cosine, sine = solution.tolist()
    return Sine(offset, slope, cosine, sine, frequency)
