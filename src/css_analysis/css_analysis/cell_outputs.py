# SPDX-License-Identifier: Apache-2.0
"""What the cells of a mission put out at any place and attitude, by the signal chain that flies."""

from typing import Protocol

import numpy as np

from css_common.codec import Sample
from css_common.mission import Mission
from css_common.vectors import Vec3

NO_ERRORS = ("degradation=0", "noise=0")
"""Parameters of the node that simulates the cells, without what differs from draw to draw."""


class Surroundings(Protocol):
    """What lights the cells: `css_environment.ephemeris.EnvironmentState`, or a row of a recorded truth."""

    @property
    def r_n(self) -> Vec3:
        """Position [m]."""

    @property
    def sun_n(self) -> Vec3:
        """Direction of the Sun."""

    @property
    def solar_flux(self) -> float:
        """Relative to 1 AU."""

    @property
    def illumination(self) -> float:
        """Part of the solar disc in view."""


class Cells:
    """The cells of a mission, to be put into any place and attitude."""

    def __init__(self, mission: Mission, name: str, *overrides: str) -> None:
        """Prepares the chain of the mission's cells.

        Args:
            mission: whose cells.
            name: of the node that simulates them.
            overrides: KEY=VALUE on top of the mission.
        """
        mission = mission.with_overrides(overrides)
        node = mission.node(name)
        self._component = node.component(node.name, node.values)
        self._epoch_ns = mission.epoch_ns

    def outputs(self, time_s: float, surroundings: Surroundings, sigma_bn: np.ndarray) -> np.ndarray:
        """(N,) outputs [-] at a time [s] after the epoch."""
        stamp_ns = self._epoch_ns + round(time_s * 1e9)
        truth = Sample(
            stamp_ns,
            "",
            r_n=np.array(surroundings.r_n),
            sigma_bn=sigma_bn,
            sun_n=np.array(surroundings.sun_n),
            solar_flux=surroundings.solar_flux,
            illumination=surroundings.illumination,
        )
        voltages = self._component.cycle(stamp_ns, {"truth": truth})["voltages"]
        assert isinstance(voltages, Sample)  # an output of each step
        return voltages.voltages
