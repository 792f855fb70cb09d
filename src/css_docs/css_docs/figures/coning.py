# SPDX-License-Identifier: Apache-2.0
"""The spectrum of the Sun angles of a flight, and what it cannot tell apart."""

import numpy as np
from matplotlib.figure import Figure

from css_analysis.figure_style import BLUE, GREY, VERMILION, legend, new_figure
from css_common.mission import load_mission
from css_estimation.spin.coning_spectrum import fourier_spectrum, sampling_rate
from css_papers.esprit.spinning import fly_spinning

CAPTION = """\
Amplitude of the Sun angles of `esprit_2006` from the booms to 130 s, one sample a turn. Below half of the sampling
rate (solid line) there is one peak, of 1.63 Hz; it stands as well for its mirror, the 3.82 Hz that the payload
really cones with (dashed)."""

_FROM_S = 69.18


def figure() -> Figure:
    """Spectrum, sampling rate, truth."""
    flight = fly_spinning(load_mission("esprit_2006", ["mission.duration=130", "coning.legs=[69.18, 130.0]"]))
    time, angle = flight.passages.time, flight.passages.angle
    time, angle = time[time > _FROM_S], angle[time > _FROM_S]
    spectrum = fourier_spectrum(time, angle)
    rate = sampling_rate(time)
    figure = new_figure(7.5, 3.0)
    axes = figure.subplots()
    axes.plot(spectrum.frequency, np.degrees(spectrum.amplitude), color=BLUE, label="Fourier transform")
    mirrored = rate - spectrum.frequency
    axes.plot(mirrored, np.degrees(spectrum.amplitude), color=BLUE, linewidth=0.6, alpha=0.6, label="its mirror")
    axes.axvline(0.5 * rate, color=GREY, label="half of the sampling rate")
    axes.axvline(1.0 / 0.2618, color=VERMILION, linestyle="--", label="true coning")
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel("amplitude [deg]")
    axes.set_xlim(0.0, rate)
    legend(axes)
    return figure
