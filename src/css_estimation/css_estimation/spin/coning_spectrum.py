# SPDX-License-Identifier: Apache-2.0
"""Frequency of coning from Sun angles that are sampled once or a few times a turn, with all of its aliases.

A sample a turn cannot tell a frequency f from |k fs +- f|. Unequal times hardly help: coning itself makes them
unequal, by a few per cent. What tells candidates apart is outside the spectrum: the moments of inertia, or the motion
that each implies between the pulses of a passage.
"""

from typing import NamedTuple

import numpy as np

LEAST_FREQUENCY = 0.05
"""Below this [Hz] a change of the Sun angle is a drift."""

LEAST_SAMPLES = 16
"""Fewer Sun angles give no spectrum."""

MOST_CANDIDATES = 4
_LARGEST_RATIO = 2.0  # of axial and transverse moment of inertia, which no rigid body exceeds
_OVERSAMPLING = 8
_REFINEMENTS = 3


class Spectrum(NamedTuple):
    """Amplitudes over frequency."""

    frequency: np.ndarray  # (F,) [Hz]
    amplitude: np.ndarray  # (F,) [rad] of a sinusoid


class Candidate(NamedTuple):
    """One frequency that the samples may stand for."""

    frequency: float  # [Hz] that fits the true times best
    sequence_frequency: float  # [Hz] as the Fourier transform of the sequence has it
    power: float  # Lomb-Scargle, 1: all of the variance
    inertia_ratio: float


def detrended(time: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Angles (M,) [rad] less a straight line in time (M,) [s]."""
    return angle - np.polyval(np.polyfit(time - time[0], angle, 1), time - time[0])


def sequence_numbers(time: np.ndarray) -> np.ndarray:
    """(M,) which passage each sample is of, from 0: whole multiples of the usual time between them."""
    steps = np.diff(time)
    return np.concatenate(([0], np.cumsum(np.maximum(np.rint(steps / np.median(steps)), 1.0)))).astype(np.int64)


def fourier_spectrum(time: np.ndarray, angle: np.ndarray) -> Spectrum:
    """Amplitudes of the sequence as if its times (M,) [s] were equidistant, the paper's method; Hann window.

    Passages that are missing are filled in between their neighbours, so that what follows keeps its phase.
    """
    number = sequence_numbers(time)
    whole = np.arange(number[-1] + 1)
    sequence = np.interp(whole, number, detrended(time, angle))
    window = np.hanning(len(whole))
    length = _OVERSAMPLING * len(whole)
    amplitude = np.abs(np.fft.rfft(sequence * window, length)) / (0.5 * window.sum())
    return Spectrum(np.fft.rfftfreq(length, 1.0 / sampling_rate(time)), amplitude)


def sampling_rate(time: np.ndarray) -> float:
    """Mean passages a second [Hz], those that are missing counted."""
    return float(sequence_numbers(time)[-1] / (time[-1] - time[0]))


def peak_frequency(spectrum: Spectrum) -> float:
    """Frequency [Hz] of the largest amplitude, by a parabola through its neighbours."""
    allowed = np.where(spectrum.frequency >= LEAST_FREQUENCY, spectrum.amplitude, 0.0)
    i = int(np.argmax(allowed))
    if not 0 < i < len(allowed) - 1:
        return float(spectrum.frequency[i])
    a, b, c = spectrum.amplitude[i - 1 : i + 2]
    curvature = a - 2.0 * b + c
    shift = 0.5 * (a - c) / curvature if curvature < 0.0 else 0.0
    return float(spectrum.frequency[i] + shift * (spectrum.frequency[1] - spectrum.frequency[0]))


def lomb_scargle(time: np.ndarray, angle: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """(F,) share of the variance of the angles that a sinusoid of each frequency [Hz] takes, at the true times."""
    residual = detrended(time, angle)
    from scipy.signal import lombscargle  # two seconds to load, for the few that look at coning

    return lombscargle(time - time[0], residual, 2.0 * np.pi * frequency, normalize=True, floating_mean=True)


def alias_frequencies(base: float, rate: float, highest: float) -> list[float]:
    """All |k rate +- base| [Hz] above zero and up to `highest`, the lowest first."""
    found = {round(float(base), 12)}
    for k in range(1, int(np.ceil((highest + base) / rate)) + 1):
        found |= {round(float(abs(k * rate - base)), 12), round(float(k * rate + base), 12)}
    return sorted(f for f in found if LEAST_FREQUENCY <= f <= highest)


def candidates(time: np.ndarray, angle: np.ndarray, spin: float, half_angle: float) -> list[Candidate]:
    """The frequencies of coning that the Sun angles allow, the lowest first, at most four.

    Args:
        time: (M,) [s] of the samples, growing; at least `LEAST_SAMPLES`.
        angle: (M,) Sun angles [rad].
        spin: turns a second [Hz].
        half_angle: [rad] of the cone, for the moments of inertia that each candidate implies.
    """
    rate = sampling_rate(time)
    base = peak_frequency(fourier_spectrum(time, angle))
    result = []
    for sequence_frequency in alias_frequencies(base, rate, _LARGEST_RATIO * spin):
        frequency, power = _refined(time, angle, sequence_frequency)
        ratio = implied_inertia_ratio(frequency, spin, half_angle)
        if 0.0 < ratio < _LARGEST_RATIO:
            result.append(Candidate(frequency, sequence_frequency, power, ratio))
    return result[:MOST_CANDIDATES]


def implied_inertia_ratio(frequency: float, spin: float, half_angle: float) -> float:
    """Axial over transverse moment of inertia of a body with this coning frequency and spin [Hz], torque-free.

    The spin counts turns relative to the Sun, outside of the cone.
    """
    axial = frequency * np.cos(half_angle)
    return float(axial / (spin - frequency + axial))


def _refined(time: np.ndarray, angle: np.ndarray, frequency: float) -> tuple[float, float]:
    """Frequency of the largest power near one, and the power."""
    width = 1.0 / (time[-1] - time[0])
    power = 0.0
    for _ in range(_REFINEMENTS):
        grid = frequency + width * np.linspace(-1.0, 1.0, 21)
        powers = lomb_scargle(time, angle, grid)
        best = int(np.argmax(powers))
        frequency, power = float(grid[best]), float(powers[best])
        width *= 0.15
    return frequency, power
