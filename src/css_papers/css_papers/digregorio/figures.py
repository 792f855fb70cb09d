# SPDX-License-Identifier: Apache-2.0
"""Figures of the slides: error against time, number of valid diodes against time, bounds by the covariance."""

from pathlib import Path

import numpy as np
from matplotlib.ticker import MaxNLocator

from css_analysis.figure_style import BLUE, VERMILION, draw_series, legend, logarithmic, new_figure, save, style
from css_monte_carlo.percentiles import over_cases
from css_papers.digregorio.flights import ERROR, FILTERS, LIT, SIGMA, VECTOR, VOLTAGE, Flown

_COLOURS = {VECTOR: VERMILION, VOLTAGE: BLUE}
_WIDTH = 8.6


def write_case(flown: Flown, case: int, title: str, file: Path) -> Path:
    """One case: error of both filters with the bound of their covariance, and the diodes that count in each."""
    with style():
        figure = new_figure(_WIDTH, 6.0)
        errors, bounds, lit = figure.subplots(3, 1, sharex=True)
        for name, label in FILTERS.items():
            samples = flown.samples[name][case]
            time = flown.sample_s * np.arange(samples.shape[1]) / 60.0
            draw_series(errors, time, samples[ERROR], _COLOURS[name], label)
            draw_series(bounds, time, 3.0 * samples[SIGMA], _COLOURS[name], label)
            draw_series(lit, time, samples[LIT], _COLOURS[name], label)
        errors.set_title(title)
        errors.set_ylabel("Euler angle\n[deg]")
        bounds.set_title("Bound by the covariance")
        bounds.set_ylabel("3 sigma\n[deg]")
        lit.set_title("Diodes that contribute")
        lit.set_ylabel("number")
        lit.yaxis.set_major_locator(MaxNLocator(integer=True))
        lit.set_xlabel("time [min]")
        for axes in (errors, bounds):
            logarithmic(axes)
        for axes in (errors, bounds, lit):
            legend(axes)
        return save(figure, file)


def write_cases(flown: dict[str, Flown], file: Path) -> Path:
    """All cases: median and 95th percentile of the error against time for each set of diodes."""
    with style():
        figure = new_figure(_WIDTH, 1.9 * len(flown))
        all_axes = figure.subplots(len(flown), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
        for axes, (diodes, flights) in zip(all_axes, flown.items(), strict=True):
            for name, label in FILTERS.items():
                over = over_cases(flights.samples[name][:, ERROR])
                time = flights.sample_s * np.arange(len(over["p50"])) / 60.0
                axes.plot(time, over["p50"], color=_COLOURS[name], label=f"{label}, median")
                axes.plot(time, over["p95"], color=_COLOURS[name], linestyle=(0, (4, 2)), label=f"{label}, 95 %")
            axes.set_title(f"Diodes: {diodes}")
            axes.set_ylabel("Euler angle\n[deg]")
            logarithmic(axes)
            legend(axes)
        all_axes[-1].set_xlabel("time [min]")
        return save(figure, file)
