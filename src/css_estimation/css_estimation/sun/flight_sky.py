# SPDX-License-Identifier: Apache-2.0
"""Sun, shadow, light and field of the Earth as the flight's own orbit model has them, for estimators of the Sun.

The Earth is the filter's own: a mean reflectivity without the clouds of the day.
"""

from typing import NamedTuple

from css_common.declared import given, part, table_of
from css_common.epochs import mission_epoch
from css_common.orbit_section import ORBIT_SOURCE
from css_common.schema import Values, flag
from css_environment.mission_environment import MissionEnvironment
from css_estimation.mean_earth import MeanEarth, PredictedLight
from css_estimation.sun.eclipse_detector import SOURCE
from css_estimation.sun.sun_heading import (
    PREDICTION_ECLIPSED,
    PREDICTION_SUNLIT,
    PREDICTION_UNKNOWN,
    UNKNOWN_SKY,
    Sky,
)

USE_ORBIT = flag("use_orbit", True, "use the place in orbit, where the mission has one: shadow and light of the Earth")

USE_FIELD = flag(
    "use_field", False, "take the measured magnetic field for a direction, where the place in orbit is known"
)

# Half of the solar disc: the middle of the penumbra.
_HALF = 0.5


class SkyParameters(NamedTuple):
    """Of the flight's own models."""

    use_orbit: bool = given(USE_ORBIT)
    earth: MeanEarth = part(MeanEarth)


PARAMETERS = table_of(SkyParameters)


class FlightSky:
    """Models along the orbit of the mission's `orbit` section.

    Attributes:
        has_light: the light of the Earth is predicted.
    """

    def __init__(self, values: Values, with_light: bool, with_field: bool = False) -> None:
        """Takes sections mission and orbit.

        Args:
            with_light: predict the light of the Earth, by the parameters of `MeanEarth`.
            with_field: predict its magnetic field.
        """
        self._environment = MissionEnvironment(values, field=with_field)
        self._epoch_ns = mission_epoch(values.mission)
        self.has_light = with_light
        self._predicted = PredictedLight(values) if with_light else None
        self._light = UNKNOWN_SKY.light if self._predicted is None else self._predicted.light

    def at(self, stamp_ns: int) -> Sky:
        """What the models say at a stamp [ns of UTC]; the table of light is the same one each time, written anew."""
        e = self._environment.at((stamp_ns - self._epoch_ns) * 1e-9)
        if self._predicted is not None and e.illumination > 0.0:
            self._predicted.at(e)
        predicted = PREDICTION_ECLIPSED if e.illumination < _HALF else PREDICTION_SUNLIT
        return Sky(True, predicted, e.sun_n, e.solar_flux, e.illumination, e.r_n, e.field_n, self._light)


def flight_sky(values: Values) -> FlightSky | None:
    """The sky that a Sun estimator's values ask for; None when cells decide on eclipse and nobody needs the rest."""
    if not asks_for_sky(values):
        return None
    with_light = knows_place(values)
    return FlightSky(values, with_light, with_light and USE_FIELD in values and values[USE_FIELD])


def asks_for_sky(values: Values) -> bool:
    """Whether a Sun estimator's values ask for a model of where the spacecraft is."""
    return (SOURCE in values and values[SOURCE] in ("model", "both")) or knows_place(values)


def hears_flag(values: Values) -> bool:
    """Whether an estimator with these values takes the shadow from what the spacecraft says of it."""
    return SOURCE in values and values[SOURCE] == "flag"


def flagged(sky: Sky, sunlight: float | None) -> Sky:
    """A sky whose shadow is what the spacecraft says.

    Args:
        sunlight: part of the Sun's light that it says it is in; None: it says nothing, and the cells decide.
    """
    if sunlight is None:
        return sky._replace(predicted=PREDICTION_UNKNOWN)
    predicted = PREDICTION_ECLIPSED if sunlight < _HALF else PREDICTION_SUNLIT
    return sky._replace(predicted=predicted, illumination=sunlight)


def knows_place(values: Values) -> bool:
    """Whether an estimator with these values predicts the light of the Earth."""
    return USE_ORBIT in values and values[USE_ORBIT] and values[ORBIT_SOURCE] != "none"


def sky_at(sky: FlightSky | None, stamp_ns: int) -> Sky:
    """The sky at a stamp [ns of UTC]."""
    return UNKNOWN_SKY if sky is None else sky.at(stamp_ns)
