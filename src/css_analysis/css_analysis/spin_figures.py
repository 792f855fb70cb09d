# SPDX-License-Identifier: Apache-2.0
"""Figures of a spinning payload as the ESPRIT paper draws them: rate and Sun angle, coning angle, spectrum."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from css_analysis.figure_style import (
    BLUE,
    DARK_GREY,
    GREY,
    VERMILION,
    colours,
    legend,
    level_line,
    new_figure,
    save,
    style,
)
from css_estimation.spin.coning import Coning, Passages
from css_estimation.spin.coning_angle import extremum_differences
from css_estimation.spin.coning_spectrum import fourier_spectrum, sampling_rate

_SMALL, _ROW, _ROWS = 7.0, 10.0, 3  # [points] of names of events, and how many rows of them there are

Event = tuple[float, str]
"""Time [s] and what happened."""


def write_rate_figure(passages: Passages, path: Path, events: Sequence[Event] = (), title: str = "") -> Path:
    """Rotation rate and Sun angle over time (Fig. 4)."""
    with style():
        figure = new_figure(7.5, 5.0)
        above, below = figure.subplots(2, 1, sharex=True)
        above.plot(passages.time, passages.rate / (2.0 * np.pi), ".", color=BLUE, markersize=1.5)
        above.set_ylabel("rotation rate [Hz]")
        above.set_title(title or "Rotation rate and Sun angle")
        below.plot(passages.time, np.degrees(passages.angle), ".", color=BLUE, markersize=1.5)
        below.set_ylabel("Sun angle [deg]")
        below.set_xlabel("time [s]")
        _mark_events(above, below, events)
        return save(figure, path)


def _mark_events(above: Axes, below: Axes, events: Sequence[Event]) -> None:
    """Lines through both, with names in rows of their own above the data: deployments follow each other closely."""
    low, high = above.get_ylim()
    above.set_ylim(low, high + 0.3 * (high - low))
    _, last = above.get_xlim()
    for i, (time, name) in enumerate(events):
        for axes in (above, below):
            axes.axvline(time, color=GREY, linewidth=0.8, linestyle=(0, (4, 3)))
        is_late = time > 0.8 * last
        above.annotate(
            name,
            (time, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(-3 if is_late else 3, -2 - _ROW * (i % _ROWS)),
            textcoords="offset points",
            va="top",
            ha="right" if is_late else "left",
            fontsize=_SMALL,
            color=DARK_GREY,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8},  # the next event's line ends there
        )


def write_coning_figure(passages: Passages, windows: Mapping[str, Coning], path: Path, start: float = 0.0) -> Path:
    """Coning angle of consecutive extrema over time (Fig. 5), and what the windows say of it."""
    chosen = passages.between(start, np.inf)
    differences, at = extremum_differences(chosen.angle)
    with style():
        figure = new_figure(7.5, 3.6)
        axes = figure.subplots()
        axes.plot(chosen.time[at], np.degrees(differences), ".", color=BLUE, markersize=2.0, label="max - min")
        for (name, coning), colour in zip(windows.items(), colours(len(windows)), strict=True):
            axes.hlines(
                np.degrees(coning.full_angle), coning.start, coning.end, color=colour, linewidth=1.8,
                label=f"{name}: motion fitted",
            )  # fmt: skip
            axes.hlines(
                np.degrees(coning.max_min_angle), coning.start, coning.end, color=colour, linewidth=1.2,
                linestyle=(0, (4, 3)), label=f"{name}: mean of max - min",
            )  # fmt: skip
        axes.set_ylabel("coning full angle [deg]")
        axes.set_xlabel("time [s]")
        axes.set_ylim(0.0, None)
        axes.set_title("Coning angle")
        legend(axes)
        return save(figure, path)


def write_spectrum_figure(passages: Passages, windows: Mapping[str, Coning], path: Path) -> Path:
    """Fourier transform of the Sun angles of each window (Fig. 6), mirrored at half of the sampling rate."""
    with style():
        figure = new_figure(7.5, 2.6 * max(len(windows), 1))
        grid = figure.subplots(max(len(windows), 1), 1, sharex=True, squeeze=False)[:, 0]
        for axes, (name, coning) in zip(grid, windows.items(), strict=False):
            part = passages.between(coning.start, np.nextafter(coning.end, np.inf))
            spectrum = fourier_spectrum(part.time, part.angle)
            rate = sampling_rate(part.time)
            # a real sequence says of f and of rate - f the same
            frequency = np.concatenate((spectrum.frequency, rate - spectrum.frequency[::-1]))
            amplitude = np.degrees(np.concatenate((spectrum.amplitude, spectrum.amplitude[::-1])))
            axes.plot(frequency, amplitude, color=BLUE)
            axes.axvline(0.5 * rate, color=GREY, linewidth=0.8)
            for i, candidate in enumerate(coning.candidates):
                if candidate.frequency < rate:
                    colour = VERMILION if i == coning.chosen else DARK_GREY
                    axes.annotate(
                        f"{1.0 / candidate.frequency:.4f} s" + (", chosen" if i == coning.chosen else ""),
                        (candidate.frequency, amplitude.max()),
                        xytext=(0, 3),
                        textcoords="offset points",
                        ha="center",
                        fontsize=7.5,
                        color=colour,
                    )
            axes.set_ylim(0.0, 1.25 * amplitude.max())
            axes.set_ylabel("amplitude [deg]")
            axes.set_title(f"{name}: {rate:.3f} Sun angles a second")
        grid[-1].set_xlabel("frequency [Hz]")
        return save(figure, path)


def write_alias_figure(studies: Mapping[str, Coning], spin: float, path: Path) -> Path:
    """Candidates of the coning frequency for several numbers of heads, by how badly their motion misses the pulses."""
    with style():
        figure = new_figure(7.5, 3.2)
        axes = figure.subplots()
        for i, ((name, coning), colour) in enumerate(zip(studies.items(), colours(len(studies)), strict=True)):
            frequencies = [c.frequency for c in coning.candidates]
            # rings around each other where several numbers of heads leave one candidate
            axes.plot(
                frequencies, 1e6 * np.array(coning.residuals), "o", color=colour, label=name,
                markersize=4.0 + 4.0 * i, markerfacecolor="none", markeredgewidth=1.6,
            )  # fmt: skip
        axes.set_yscale("log")
        axes.set_xlabel("candidate of the coning frequency [Hz]")
        axes.set_ylabel("pulses missed by [us]")
        axes.set_xlim(0.0, 2.0 * spin)
        level_line(axes, 1.0, "1 us")
        axes.set_title("Aliases that each number of heads leaves")
        legend(axes)
        return save(figure, path)
