# SPDX-License-Identifier: Apache-2.0
"""Allan deviation of the simulated gyro."""

import numpy as np
from matplotlib.figure import Figure

from css_analysis.figure_style import BLUE, GREY, legend, new_figure
from css_common.kernel import outer_kernel
from css_common.random_streams import random_key
from css_common.schema import default_values
from css_sim import gyro
from css_sim.fault_effects import FAULT
from css_sim.nodes.gyro import Gyro

CAPTION = """\
Allan deviation of a simulated gyro at rest, 0.01 deg/s of white noise a sample and a bias that walks by 2e-4 deg/s
a sample, at 10 Hz, beside the closed forms of both."""

_STEPS = 200_000
_PERIOD = 0.1  # [s]
_NOISE, _WALK = 0.01, 2e-4  # [deg/s]


@outer_kernel
def _readings(p, errors, faults, key, out) -> None:
    for k in range(out.shape[0]):
        out[k] = gyro.measure(p, errors, faults, key, k, (0.0, 0.0, 0.0))[0]


def figure() -> Figure:
    """Measured and stated."""
    values = default_values(Gyro.table(), noise_deg_s=_NOISE, bias_walk_deg_s=_WALK)
    p, key = gyro.parameters(values), random_key(1, 0)
    out = np.empty(_STEPS)
    _readings(p, gyro.draw_errors(p, key), np.zeros(0, FAULT), key, out)
    counts = np.unique(np.logspace(0, np.log10(_STEPS / 10), 40).astype(int))
    tau = _PERIOD * counts
    figure = new_figure(7.5, 3.0)
    axes = figure.subplots()
    axes.loglog(tau, [np.degrees(_allan(out, count)) for count in counts], color=BLUE, label="simulated")
    stated = np.sqrt(_NOISE**2 / counts + _WALK**2 * counts / 3.0)
    axes.loglog(tau, stated, "--", color=GREY, label="closed form")
    axes.set_xlabel("averaging time [s]")
    axes.set_ylabel("Allan deviation [deg/s]")
    legend(axes)
    return figure


def _allan(readings: np.ndarray, count: int) -> float:
    means = readings[: len(readings) // count * count].reshape(-1, count).mean(axis=1)
    return float(np.sqrt(0.5 * np.mean(np.diff(means) ** 2)))
