# SPDX-License-Identifier: Apache-2.0
"""Attitude errors of the flight, and the distribution of normalised errors over cases."""

from pathlib import Path

import numpy as np
from scipy import stats

from css_analysis.figure_style import BLUE, VERMILION, legend, logarithmic, new_figure, save, style
from css_analysis.spin_consistency import AttitudeCases
from css_papers.esprit.flights import AttitudeErrors


def write_attitude_figure(errors: AttitudeErrors, cases: AttitudeCases, path: Path) -> Path:
    """Error angle over time, and the cumulative distribution of NEES beside chi-square with 3 degrees of freedom."""
    with style():
        figure = new_figure(7.5, 5.0)
        above, below = figure.subplots(2, 1)
        above.plot(errors.time, np.degrees(errors.angle), ".", color=BLUE, markersize=1.5)
        logarithmic(above)
        above.set_xlabel("time [s]")
        above.set_ylabel("attitude error [deg]")
        above.set_title("Attitude against the truth")
        ordered = np.sort(cases.nees)
        below.plot(ordered, (np.arange(len(ordered)) + 0.5) / max(len(ordered), 1), color=BLUE, label="cases")
        x = np.linspace(0.0, 15.0, 300)
        below.plot(x, stats.chi2.cdf(x, 3), color=VERMILION, label="chi-square, 3")
        below.set_xlim(0.0, 15.0)
        below.set_xlabel("normalised estimation error squared")
        below.set_ylabel("share of cases")
        legend(below)
        return save(figure, path)
