# SPDX-License-Identifier: Apache-2.0
"""The Sun that lit cells see at one stamp, for an attitude from two directions.

Three or more lit cells that span space give it by least squares; of cells in a plane two Suns fit, between which the
angle to the field and the dark cells decide (`attitude_start`). The light of the Earth is not taken off: it is part of
the error of a cell. Cells that are held for failed are left out (`cell_health`), judged without any rate.
"""

from typing import NamedTuple

import numpy as np

from css_common.declared import built, given, made, part, table_of
from css_common.kernel import typed_call
from css_common.schema import Values, real
from css_common.vectors import Vec3, dot, norm, scale
from css_environment.ephemeris import EnvironmentState
from css_estimation.attitude.attitude_start import chosen_sun
from css_estimation.attitude.lit_sun_vector import lit_sun
from css_estimation.health import cell_health
from css_estimation.health.cell_health import trust_cells
from css_estimation.health.cell_memory import new_memory
from css_estimation.health.cell_options import ENABLED, CellHealthParameters
from css_estimation.sun.cell_layout import brightest, cell_layout
from css_estimation.sun.sun_heading import RATE_NONE, UNKNOWN_SKY
from css_estimation.symmetric import Symmetric, isotropic

_FULL_DISC = 0.99


def _tesla_squared(sigma_nt: float) -> float:
    return (1e-9 * sigma_nt) ** 2


class CellSunParameters(NamedTuple):
    """Which cells count, and how far they are believed."""

    gate: float = given(real("gate", 0.1, "-", "a cell above it is lit", low=0.0, high=1.0))
    minimum_output: float = given(
        real("minimum_output", 0.2, "-", "no Sun unless a cell is above it", low=0.0, high=1.0)
    )
    cell_sigma: float = given(
        real(
            "cell_sigma",
            0.05,
            "-",
            "error of a cell's output, the light of the Earth included, 1 sigma",
            low=0.0,
            open_low=True,
            high=1.0,
        )
    )
    judges_cells: bool = given(ENABLED)
    health: CellHealthParameters = part(CellHealthParameters)
    field_variance: float = made(
        _tesla_squared,
        real(
            "field_sigma_nt",
            200.0,
            "nT",
            "least error of magnetometer and field model beside cells, per axis, 1 sigma",
            low=0.0,
            open_low=True,
            high=1e6,
        ),
    )


PARAMETERS = table_of(CellSunParameters)


class SeenSun(NamedTuple):
    """The Sun of one stamp."""

    sun_b: Vec3  # unit vector
    covariance: Symmetric  # [rad^2], about each axis as about the worst
    mask: int  # cells that count


class CellSun:
    """What the cells of a mission say of the Sun.

    Attributes:
        field_variance: least variance of each component of the field [T^2].
        verdicts: (N,) of `css_common.health.VERDICT`.
    """

    def __init__(self, values: Values) -> None:
        """Takes the section cells, and `PARAMETERS`."""
        self._p = built(CellSunParameters, values)
        self._cells = cell_layout(values).cells
        self.field_variance = self._p.field_variance
        self._lit_sun, self._chosen = typed_call(lit_sun), typed_call(chosen_sun)
        self._judge = typed_call(trust_cells)
        self._state, self._memory = cell_health.initial_state(), new_memory(len(self._cells))
        self.verdicts = self._memory.verdicts

    @property
    def cycles(self) -> int:
        """How many have been judged."""
        return self._state.step

    @property
    def isolated(self) -> int:
        """Mask of the cells that are held for failed."""
        return self._state.isolated

    def trusted(self, voltages: np.ndarray, dt: float, at: EnvironmentState) -> np.ndarray:
        """The outputs (N,) of a cycle that can be trusted, NaN for the others.

        Args:
            voltages: (N,) outputs, NaN where a cell is missing.
            dt: [s] since the last cycle.
            at: what the models say at its stamp.
        """
        sky = UNKNOWN_SKY._replace(known=True, illumination=float(at.illumination))
        p = self._p
        self._state = self._judge(
            p.judges_cells, p.health, self._state, self._memory, dt, voltages, (0.0, 0.0, 0.0), RATE_NONE, sky
        )
        return self._memory.trusted

    def seen(self, voltages: np.ndarray, field_b: Vec3, at: EnvironmentState) -> SeenSun | None:
        """The Sun of a stamp; None when the cells do not tell it, or the Earth hides a part of it.

        Args:
            voltages: (N,) outputs, NaN where a cell is missing.
            field_b: measured field [T].
            at: what the models say of Sun and field at the stamp.
        """
        p, strength = self._p, norm(field_b)
        modelled = norm(at.field_n)
        if at.illumination < _FULL_DISC or not strength > 0.0 or not modelled > 0.0:
            return None
        outputs = voltages / at.solar_flux
        top = brightest.py_func(outputs)
        if top < 0 or outputs[top] <= p.minimum_output:
            return None
        mask = sum(1 << i for i, output in enumerate(outputs.tolist()) if output > p.gate)
        sun = self._lit_sun(self._cells, outputs, mask, top)
        along_b = scale(1.0 / strength, field_b)
        cosine = dot(at.sun_n, at.field_n) / modelled
        sun_b, sigma, known = self._chosen(self._cells, outputs, mask, sun, cosine, along_b, p.cell_sigma, p.gate)
        return SeenSun(sun_b, isotropic(sigma * sigma), mask) if known else None
