# SPDX-License-Identifier: Apache-2.0
"""TRIAD against its covariance."""

import math

import numpy as np
from matplotlib.figure import Figure

from css_analysis.figure_style import BLUE, ORANGE, legend, logarithmic, new_figure
from css_common.vectors import vector_of
from css_estimation.attitude.triad import triad, triad_covariance

CAPTION = """\
Attitude error of TRIAD against the angle between its two directions: root mean square of 400 draws, and the square
root of the trace of the covariance. Primary 0.1 deg, secondary 0.5 deg about each axis across it."""

_SIGMAS = (math.radians(0.1), math.radians(0.5))
_DRAWS = 400


def figure() -> Figure:
    """Draws and formula."""
    rng = np.random.default_rng(1)
    angles = np.radians(np.arange(8.0, 91.0, 4.0))
    drawn, stated = [], []
    for angle in angles:
        w1, w2 = np.array([1.0, 0.0, 0.0]), np.array([math.cos(angle), math.sin(angle), 0.0])
        covariance = triad_covariance(vector_of(w1), vector_of(w2), *_SIGMAS)
        stated.append(math.sqrt(covariance[0] + covariance[3] + covariance[5]))
        squares = [_error(rng, w1, w2) ** 2 for _ in range(_DRAWS)]
        drawn.append(math.sqrt(float(np.mean(squares))))
    figure = new_figure(7.5, 3.0)
    axes = figure.subplots()
    axes.plot(np.degrees(angles), np.degrees(drawn), "o", markersize=3.5, color=BLUE, label="drawn")
    axes.plot(np.degrees(angles), np.degrees(stated), color=ORANGE, label="covariance")
    logarithmic(axes)
    axes.set_xlabel("angle between the directions [deg]")
    axes.set_ylabel("attitude error [deg]")
    legend(axes)
    return figure


def _error(rng: np.random.Generator, w1: np.ndarray, w2: np.ndarray) -> float:
    """Angle [rad] of the attitude from noisy directions; the true one is none."""
    noisy = [_turned(rng, w, sigma) for w, sigma in zip((w1, w2), _SIGMAS, strict=True)]
    _, dcm = triad(*map(vector_of, (*noisy, w1, w2)))
    return math.acos(min(1.0, 0.5 * (float(np.trace(np.array(dcm))) - 1.0)))


def _turned(rng: np.random.Generator, w: np.ndarray, sigma: float) -> np.ndarray:
    error = sigma * rng.standard_normal(3)
    moved = w + np.cross(error, w)
    return moved / np.linalg.norm(moved)
