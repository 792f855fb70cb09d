# SPDX-License-Identifier: Apache-2.0
"""A made-up recording with everything that the page of a flight can show."""

from pathlib import Path

import numpy as np
from synthetic_flight import columns, estimates, record, stamps, tilted, truth

from css_msgs.msg import ControlStatus, CssVoltages, RodDipoleCommand, SpacecraftState, SunEstimate, WheelState

STEPS = 9000
SPIKE = 4321
SIGMA = 0.01


def flight(folder: Path, mission: str = "") -> Path:
    """A recording with everything that a page can show; one sample of a cell's output is a spike."""
    pointing = 90.0 * np.exp(-np.arange(STEPS) / 900.0) + 5.0
    lit = np.where(np.arange(STEPS) < 6000, 1.0, 0.0)
    cells = columns(CssVoltages, stamps(STEPS), voltages=0.5)
    cells.voltages[SPIKE, 3] = 1.25
    covariance = np.tile((SIGMA**2 * np.eye(3)).ravel(), (STEPS, 1))
    ekf = estimates(tilted(pointing + 1.0), covariance=covariance, nis=2.0, nis_dof=2, lit_mask=0b1011, rate_source=1)
    ekf.validity[:100] = 0
    ekf.isolated[5000:] = 0b100
    control = columns(ControlStatus, stamps(STEPS), mode=np.where(np.arange(STEPS) < 3000, 3, 4), reason=4)
    topics = {
        "/truth": (SpacecraftState, truth(pointing, lit, r_n=[[7e6, 0.0, 0.0]], omega_bn_b=[[0.01, 0.0, 0.0]])),
        "/css/voltages": (CssVoltages, cells),
        "/ekf/sun_estimate": (SunEstimate, ekf),
        "/wheels/state": (WheelState, columns(WheelState, stamps(STEPS), speed=10.0)),
        "/rods/dipole_command": (RodDipoleCommand, columns(RodDipoleCommand, stamps(STEPS), dipole=0.1)),
        "/control/status": (ControlStatus, control),
    }
    return record(folder, topics, mission)
