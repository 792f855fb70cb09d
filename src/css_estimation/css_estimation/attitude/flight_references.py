# SPDX-License-Identifier: Apache-2.0
"""What the flight's own models say about Sun, field and Earthlight at its place: directions known in n.

They are computed with the filter's parameters, not with the truth's: a lower degree of the field, an offset or another
reflectivity of the Earth make filter and truth differ as they do in flight.
"""

from typing import NamedTuple

import numpy as np

from css_common.declared import built, given, made, part, table_of
from css_common.schema import Values, flag, integer, reals
from css_common.vectors import Vec3, add, vector_of
from css_environment.magnetic_field import HIGHEST_DEGREE
from css_environment.mission_environment import MissionEnvironment
from css_estimation.mean_earth import MeanEarth, PredictedLight

FIELD_DEGREE = integer(
    "reference.field_degree", HIGHEST_DEGREE, "-", "highest degree of the field model", low=1, high=HIGHEST_DEGREE
)
COMPENSATE = flag("albedo.compensate", True, "take the predicted light of the Earth off each cell's output")

_FULL_DISC = 0.99


def _tesla(field_nt: np.ndarray) -> Vec3:
    return vector_of(1e-9 * field_nt)


class ReferenceParameters(NamedTuple):
    """Of the flight's own models."""

    field_degree: int = given(FIELD_DEGREE)
    field_offset_n: Vec3 = made(  # [T]
        _tesla,
        reals("reference.field_offset_nt", (0.0, 0.0, 0.0), "nT", "error put on the field model, in n", length=3),
    )
    compensate: bool = given(COMPENSATE)
    earth: MeanEarth = part(MeanEarth)


PARAMETERS = table_of(ReferenceParameters)


class References(NamedTuple):
    """Directions in n at one instant."""

    sun_n: Vec3  # unit vector to the Sun
    intensity: float  # of sunlight, 1 at 1 AU
    sunlit: bool  # outside of shadow and penumbra
    field_n: Vec3  # [T]


class FlightReferences:
    """Models along the orbit of the mission's `orbit` section.

    Attributes:
        light: (192,) patches of light of the Earth of the last `at`, zeros without compensation.
    """

    def __init__(self, values: Values) -> None:
        """Takes sections mission and orbit, and `PARAMETERS`."""
        p = built(ReferenceParameters, values)
        self._environment = MissionEnvironment(values, field=True, field_degree=p.field_degree)
        self._offset_n = p.field_offset_n
        self._compensate = p.compensate
        self._predicted = PredictedLight(values)
        self.light = self._predicted.light

    def at(self, elapsed_s: float) -> References:
        """References at an instant [s after the epoch]; `light` is renewed."""
        e = self._environment.at(elapsed_s)
        sunlit = e.illumination > _FULL_DISC
        if self._compensate and sunlit:
            self._predicted.at(e)
        return References(e.sun_n, e.solar_flux * e.illumination, sunlit, add(e.field_n, self._offset_n))
