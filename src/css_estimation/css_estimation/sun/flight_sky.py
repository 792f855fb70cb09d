# SPDX-License-Identifier: Apache-2.0
"""Sun, shadow and light of the Earth as the flight's own orbit model has them, for estimators of the Sun.

The Earth is the filter's own: a mean reflectivity without the clouds of the day.
"""

from typing import NamedTuple

import numpy as np

from css_common.declared import built, given, table_of
from css_common.epochs import parse_utc
from css_common.kernel import typed_call
from css_common.schema import Values, choice, flag, real
from css_environment.earth_light import albedo_sources, new_earth_view, new_light
from css_environment.mission_environment import MissionEnvironment
from css_environment.reflectivity import named_reflectivity
from css_estimation.sun.sun_heading import PREDICTION_ECLIPSED, PREDICTION_SUNLIT, UNKNOWN_SKY, Sky

USE_ORBIT = flag("use_orbit", True, "use the place in orbit, where the mission has one: shadow and light of the Earth")

# Half of the solar disc: the middle of the penumbra.
_HALF = 0.5


class SkyParameters(NamedTuple):
    """Of the flight's own models."""

    use_orbit: bool = given(USE_ORBIT)
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


PARAMETERS = table_of(SkyParameters)


class FlightSky:
    """Models along the orbit of the mission's `orbit` section.

    Attributes:
        has_light: the light of the Earth is predicted.
    """

    def __init__(self, values: Values, with_light: bool) -> None:
        """Takes sections mission and orbit.

        Args:
            with_light: predict the light of the Earth, with `PARAMETERS`.
        """
        self._environment = MissionEnvironment(values, field=False)
        self._epoch_ns = parse_utc(values.mission.epoch)
        self._light = new_light()
        self.has_light = with_light
        self._reflectivity: np.ndarray | None = None
        if with_light:
            p = built(SkyParameters, values)
            grid = named_reflectivity(p.reflectivity, p.constant, self._epoch_ns)
            self._reflectivity = np.minimum(p.factor * grid.mean, 1.0)
            self._view = new_earth_view()
            self._sources = typed_call(albedo_sources)

    def at(self, stamp_ns: int) -> Sky:
        """What the models say at a stamp [ns of UTC]; the table of light is the same one each time, written anew."""
        e = self._environment.at((stamp_ns - self._epoch_ns) * 1e-9)
        if self._reflectivity is not None and e.illumination > 0.0:
            self._sources(self._view, e.r_n, e.sun_n, e.solar_flux, e.dcm_en, self._reflectivity, self._light)
        predicted = PREDICTION_ECLIPSED if e.illumination < _HALF else PREDICTION_SUNLIT
        return Sky(True, predicted, e.sun_n, e.solar_flux, e.illumination, self._light)


def flight_sky(values: Values) -> FlightSky | None:
    """The sky that a Sun estimator's values ask for; None when cells decide on eclipse and nobody needs the rest."""
    uses_light = hasattr(values, "use_orbit") and values[USE_ORBIT] and values.orbit.source != "none"
    if not uses_light and values.eclipse.source == "sensors":
        return None
    return FlightSky(values, uses_light)


def sky_at(sky: FlightSky | None, stamp_ns: int) -> Sky:
    """The sky at a stamp [ns of UTC]."""
    return UNKNOWN_SKY if sky is None else sky.at(stamp_ns)
