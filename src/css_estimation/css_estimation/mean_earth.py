# SPDX-License-Identifier: Apache-2.0
"""The Earth as a flight expects it: a mean reflectivity, without the clouds of the day, and its light at a place."""

from typing import NamedTuple

import numpy as np

from css_common.declared import built, given
from css_common.epochs import mission_epoch
from css_common.kernel import typed_call
from css_common.schema import Values, choice, real
from css_environment.earth_light import albedo_sources, new_earth_view, new_light
from css_environment.ephemeris import EnvironmentState
from css_environment.reflectivity import named_reflectivity


class MeanEarth(NamedTuple):
    """Reflectivity of the prediction."""

    reflectivity: str = given(
        choice(
            "albedo.reflectivity",
            "zonal",
            ("zonal", "knocke", "constant"),
            "the Earth of the prediction: annual means by latitude, seasonal model by latitude, one value",
        )
    )
    constant: float = given(real("albedo.constant", 0.3, "-", "the one value", low=0.0, high=1.0))
    factor: float = given(real("albedo.factor", 1.0, "-", "multiplies all reflectivities", low=0.0, high=10.0))


class PredictedLight:
    """Light of the mean Earth.

    Attributes:
        light: (192,) as `css_environment.earth_light.new_light`, of the last `at`; zeros before.
    """

    def __init__(self, values: Values) -> None:
        """Takes section mission and the parameters of `MeanEarth`."""
        p = built(MeanEarth, values)
        grid = named_reflectivity(p.reflectivity, p.constant, mission_epoch(values.mission))
        self._reflectivity = np.minimum(p.factor * grid.mean, 1.0)
        self.light = new_light()
        self._view = new_earth_view()
        self._sources = typed_call(albedo_sources)

    def at(self, e: EnvironmentState) -> None:
        """Renews `light` for a place and time."""
        self._sources(self._view, e.r_n, e.sun_n, e.solar_flux, e.dcm_en, self._reflectivity, self.light)
