# SPDX-License-Identifier: Apache-2.0
"""What a calibration looks for, in units of what is known before: one unit is one standard deviation of ignorance.

In these units the normal matrix of the data says at once what was observed. An eigenvalue L leaves 1 / sqrt(1 + L) of
the ignorance along its direction; above half of it, the flight has not told (`calibration_report.OBSERVED`).
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from css_calibration.cell_fit_model import PER_CELL, nominal_parameters
from css_estimation.sun_filter.calibration_report import OBSERVED


class Ignorance(NamedTuple):
    """Before the recording, 1 sigma."""

    gain: float = 0.3
    dark: float = 0.1
    tilt: float = math.radians(6.0)  # [rad]
    kappa: float = 0.01  # [1/K]
    earth: float = 0.5


@dataclass
class Unknowns:
    """Which parameters of N cells, and whether the brightness of the Earth, are looked for.

    Attributes:
        free: (N, 5) those of the cells.
        earth: the brightness of the Earth is one of them.
        ignorance: before the recording.
    """

    free: np.ndarray
    earth: bool
    ignorance: Ignorance

    @property
    def count(self) -> int:
        """How many there are."""
        return int(self.free.sum()) + self.earth

    @property
    def sigma(self) -> np.ndarray:
        """(count,) ignorance of each."""
        p = self.ignorance
        per_cell = np.tile([p.gain, p.dark, p.tilt, p.tilt, p.kappa], (len(self.free), 1))[self.free]
        return np.append(per_cell, [p.earth] * self.earth)

    def parameters(self, x: np.ndarray) -> tuple[np.ndarray, float]:
        """Parameters (N, 5) of the cells, and the brightness of the Earth, of unknowns (count,) in units of sigma."""
        parameters = nominal_parameters(len(self.free))
        scaled = x[: self.count] * self.sigma
        cells = int(self.free.sum())
        parameters[self.free] += scaled[:cells]
        return parameters, 1.0 + (float(scaled[-1]) if self.earth else 0.0)

    def column_of(self) -> np.ndarray:
        """(N, 5) which unknown each parameter is; -1: none."""
        columns = np.full(self.free.shape, -1)
        columns[self.free] = np.arange(int(self.free.sum()))
        return columns

    def at(self, parameters: np.ndarray, earth: float) -> np.ndarray:
        """The unknowns (count,) of parameters."""
        off = (parameters - nominal_parameters(len(self.free)))[self.free]
        return np.append(off, [earth - 1.0] * self.earth) / self.sigma


def all_of(cells: int, *, temperature: bool, earth: bool, ignorance: Ignorance) -> Unknowns:
    """Everything that a recording may tell of so many cells."""
    free = np.ones((cells, PER_CELL), np.bool_)
    free[:, -1] = temperature
    return Unknowns(free, earth, ignorance)


def is_observed(sigma: np.ndarray) -> np.ndarray:
    """Whether what is left of ignorances, in their units, counts as observed."""
    return sigma < OBSERVED


def weak_directions(information: np.ndarray) -> list[np.ndarray]:
    """Unit vectors along which a normal matrix in units of ignorance says next to nothing, the weakest first."""
    eigenvalues, vectors = np.linalg.eigh(information)
    left = 1.0 / np.sqrt(1.0 + np.maximum(eigenvalues, 0.0))
    return [vectors[:, i] for i in np.flatnonzero(left >= OBSERVED)]
