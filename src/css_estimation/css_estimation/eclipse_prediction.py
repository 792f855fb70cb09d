# SPDX-License-Identifier: Apache-2.0
"""Shadow of the Earth as the flight's own orbit model predicts it, for estimators that may ask for it."""

from css_common.epochs import parse_utc
from css_common.schema import Values
from css_environment import ephemeris
from css_environment.constants import EARTH_RADIUS
from css_environment.orbit import Orbit, TleOrbit, keplerian_orbit
from css_estimation.sun_heading import PREDICTION_ECLIPSED, PREDICTION_SUNLIT

# Half of the solar disc: the middle of the penumbra.
_HALF = 0.5


class EclipsePrediction:
    """Prediction along the orbit of the mission's `orbit` section."""

    def __init__(self, values: Values) -> None:
        self._orbit = _orbit(values)
        self._epoch_ns = parse_utc(values.mission.epoch)
        self._tables: ephemeris.Ephemeris | None = None

    def at(self, stamp_ns: int) -> int:
        """`PREDICTION_*` at a stamp [ns of UTC]."""
        elapsed_s = (stamp_ns - self._epoch_ns) * 1e-9
        if self._tables is None or not ephemeris.covers(self._tables, elapsed_s):
            start_s = ephemeris.segment_start(elapsed_s)
            self._tables = ephemeris.build_ephemeris(self._orbit, self._epoch_ns, start_s, field=False)
        illumination = ephemeris.at(self._tables, elapsed_s).illumination
        return PREDICTION_ECLIPSED if illumination < _HALF else PREDICTION_SUNLIT


def _orbit(values: Values) -> Orbit:
    o = values.orbit
    if o.source == "tle":
        return TleOrbit(o.tle_line1, o.tle_line2)
    return keplerian_orbit(
        EARTH_RADIUS + o.altitude,
        o.eccentricity,
        o.inclination_deg,
        o.raan_deg,
        o.argument_of_perigee_deg,
        o.true_anomaly_deg,
        o.j2,
    )
