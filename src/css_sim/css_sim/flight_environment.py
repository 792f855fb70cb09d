# SPDX-License-Identifier: Apache-2.0
"""The true environment along a mission's orbit, at any time of its flight."""

from functools import lru_cache

from css_common.epochs import parse_utc
from css_common.schema import Table, Values, choice, flag
from css_environment import ephemeris
from css_environment.constants import EARTH_RADIUS
from css_environment.ephemeris import EnvironmentState, Ephemeris
from css_environment.orbit import Orbit, TleOrbit, keplerian_orbit

PARAMETERS: Table = (
    choice("shadow", "conical", ("conical", "cylindrical"), "shape of the Earth's shadow"),
    flag("geomagnetic_field", True, "compute the field; without it the truth's field is zero"),
)


def orbit(values: Values) -> Orbit:
    """The orbit of the mission's `orbit` section."""
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


# Half a second of work that a node's rehearsal and its flight, or the flights of one process, share.
_segment_tables = lru_cache(maxsize=4)(ephemeris.build_ephemeris)


class FlightEnvironment:
    """Tables of the segment that was asked for last."""

    def __init__(self, values: Values) -> None:
        self._orbit = orbit(values)
        self._epoch_ns = parse_utc(values.mission.epoch)
        self._field = values.geomagnetic_field
        self._conical = values.shadow == "conical"
        self._tables: Ephemeris | None = None

    def tables(self, elapsed_s: float) -> Ephemeris:
        """Tables that hold an instant [s after the epoch]."""
        if self._tables is None or not ephemeris.covers(self._tables, elapsed_s):
            self._tables = _segment_tables(
                self._orbit,
                self._epoch_ns,
                ephemeris.segment_start(elapsed_s),
                field=self._field,
                conical_shadow=self._conical,
            )
        return self._tables

    def at(self, elapsed_s: float) -> EnvironmentState:
        """Environment at an instant [s after the epoch]."""
        return ephemeris.at(self.tables(elapsed_s), elapsed_s)
