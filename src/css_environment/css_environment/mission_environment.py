# SPDX-License-Identifier: Apache-2.0
"""The environment along the orbit of a mission, at any time: tables built segment by segment as they are needed.

The simulated truth builds one with the truth's parameters, flight software one with the flight's own.
"""

import math
from functools import lru_cache

from css_common.epochs import mission_epoch
from css_common.kernel import typed_call
from css_common.orbit_section import (
    LAUNCH_APOGEE,
    LAUNCH_AZIMUTH,
    LAUNCH_ELEVATION,
    LAUNCH_HEIGHT,
    LAUNCH_LATITUDE,
    LAUNCH_LONGITUDE,
)
from css_common.schema import Values
from css_environment import ephemeris
from css_environment.ballistic import Launch, ballistic_arc
from css_environment.constants import EARTH_RADIUS
from css_environment.ephemeris import EnvironmentState, Ephemeris
from css_environment.magnetic_field import HIGHEST_DEGREE
from css_environment.orbit import ArcsOrbit, IntegratedOrbit, Orbit, TleOrbit, keplerian_orbit

# Half a second of work that a node's rehearsal and its flight, or the flights of one process, share.
_segment_tables = lru_cache(maxsize=4)(ephemeris.build_ephemeris)
_arc = lru_cache(maxsize=4)(ballistic_arc)


def mission_launch(values: Values) -> Launch:
    """The start of a mission's ballistic arc (section orbit)."""
    return Launch(
        latitude=math.radians(values[LAUNCH_LATITUDE]),
        longitude=math.radians(values[LAUNCH_LONGITUDE]),
        height=values[LAUNCH_HEIGHT],
        azimuth=math.radians(values[LAUNCH_AZIMUTH]),
        elevation=math.radians(values[LAUNCH_ELEVATION]),
        apogee=values[LAUNCH_APOGEE],
    )


def mission_orbit(values: Values) -> Orbit:
    """The orbit of a mission's `orbit` section, whose elements hold at the mission's epoch.

    Raises:
        ValueError: a ballistic arc does not reach its apogee.
    """
    o = values.orbit
    if o.source == "ballistic":
        return _arc(mission_launch(values), mission_epoch(values.mission))
    if o.source == "tle":
        return TleOrbit(o.tle_line1, o.tle_line2)
    elements = keplerian_orbit(
        EARTH_RADIUS + o.altitude,
        o.eccentricity,
        o.inclination_deg,
        o.raan_deg,
        o.argument_of_perigee_deg,
        o.true_anomaly_deg,
        o.j2,
    )
    if o.model != "j2_integrated":
        return elements
    first = IntegratedOrbit(elements)
    if not len(o.later_elements):
        return first
    later = [IntegratedOrbit(keplerian_orbit(EARTH_RADIUS + row[1], *row[2:].tolist())) for row in o.later_elements]
    return ArcsOrbit((0.0, *o.later_elements[:, 0].tolist()), (first, *later))


class MissionEnvironment:
    """Environment of the mission's `orbit` section."""

    def __init__(
        self,
        values: Values,
        *,
        field: bool,
        conical_shadow: bool = True,
        field_degree: int = HIGHEST_DEGREE,
        orbit: Orbit | None = None,
    ) -> None:
        """Prepares the tables.

        Args:
            values: sections mission and orbit.
            field: compute the geomagnetic field; else it is zero.
            conical_shadow: shape of the Earth's shadow, with a penumbra or a cylinder.
            field_degree: highest degree of the field's spherical harmonics.
            orbit: None: that of the section.
        """
        self._orbit = mission_orbit(values) if orbit is None else orbit
        self._epoch_ns = mission_epoch(values.mission)
        self._field = field
        self._conical_shadow = conical_shadow
        self._field_degree = field_degree
        self._tables: Ephemeris | None = None
        self._at = typed_call(ephemeris.at)

    def tables(self, elapsed_s: float) -> Ephemeris:
        """Tables that hold an instant [s after the epoch]."""
        start_s = ephemeris.segment_start(elapsed_s)
        if self._tables is None or self._tables.start_s != start_s:
            self._tables = _segment_tables(
                self._orbit,
                self._epoch_ns,
                start_s,
                field=self._field,
                conical_shadow=self._conical_shadow,
                field_degree=self._field_degree,
            )
        return self._tables

    def at(self, elapsed_s: float) -> EnvironmentState:
        """Environment at an instant [s after the epoch]."""
        return self._at(self.tables(elapsed_s), elapsed_s)
