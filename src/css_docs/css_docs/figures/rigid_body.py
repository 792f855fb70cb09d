# SPDX-License-Identifier: Apache-2.0
"""What the integration of the body conserves."""

import numpy as np
from matplotlib.figure import Figure

from css_analysis.figure_style import COLOURS, legend, new_figure
from css_common.attitude import mrp_to_dcm
from css_sim.rigid_body import RotationState, propagate, rigid_body

CAPTION = """\
Torque-free body of `okeefe_2013` with four wheels at 2000 rpm, tumbling at 2 deg/s about each axis: change of
kinetic energy of the body with wheels held free of torque, and of the angular momentum in n, relative to their
size, over ten minutes at 10 Hz."""

_INERTIA = np.diag([10.5, 8.0, 6.75])
_AXES = np.sqrt(0.5) * np.array([[0, 1, 1], [0, 1, -1], [1, -1, 0], [-1, -1, 0]])
_WHEEL_INERTIA = 0.001


def figure() -> Figure:
    """Momentum and energy against time."""
    body = rigid_body(_INERTIA, _AXES, _WHEEL_INERTIA)
    state = RotationState((0.1, -0.2, 0.3), tuple(np.radians([2.0, 2.0, 2.0])))
    wheels = np.full(4, _WHEEL_INERTIA * 2000.0 * 2.0 * np.pi / 60.0)
    momenta, energies = [], []
    for _ in range(6000):
        omega, h_b = np.array(state.omega_bn_b), wheels @ _AXES
        momenta.append(np.array(mrp_to_dcm(state.sigma_bn)).T @ (_INERTIA @ omega + h_b))
        energies.append(0.5 * omega @ _INERTIA @ omega)
        state, _, _ = propagate(body, state, wheels, np.zeros(4), (0.0, 0.0, 0.0), 0.1, np.zeros(4))
    time = 0.1 * np.arange(len(energies))
    off = np.linalg.norm(np.array(momenta) - momenta[0], axis=1) / np.linalg.norm(momenta[0])
    figure = new_figure(7.5, 3.0)
    axes = figure.subplots()
    axes.semilogy(time[1:], off[1:], color=COLOURS[0], label="momentum in n")
    axes.semilogy(
        time[1:], np.abs(np.array(energies)[1:] / energies[0] - 1.0), color=COLOURS[1], label="energy of the body"
    )
    axes.set_xlabel("time [s]")
    axes.set_ylabel("relative change [-]")
    legend(axes)
    return figure
