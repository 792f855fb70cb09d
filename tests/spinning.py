# SPDX-License-Identifier: Apache-2.0
"""A spinning payload over Andoya that several tests share."""

from typing import Any

import numpy as np

from css_common.epochs import parse_utc
from css_common.mission_section import MISSION
from css_common.orbit_section import ORBIT
from css_common.random_streams import random_key
from css_common.schema import Values, default_values
from css_environment.ephemeris import at, build_ephemeris
from css_environment.mission_environment import mission_orbit
from css_estimation.spin import slit_measurement
from css_estimation.spin.slit_record import SlitRecord, read_record
from css_sensors.payload import PAYLOAD
from css_sensors.slits import SLITS
from css_sim.slit_crossings import slit_crossings, slit_geometry
from css_sim.spinning_payload import PayloadMotion, payload_motion, payload_state

EPOCH = "2006-07-01T06:39:00Z"
EPOCH_NS = parse_utc(EPOCH)
FLIGHT: dict[str, Any] = {
    "payload__phase_starts": [0.0, 62.19, 66.17, 69.18],
    "payload__spin_hz": [6.0, 6.0, 6.0, 5.45],
    "payload__coning_period": [0.65, 0.2529, 0.2529, 0.2618],
    "payload__coning_angle_deg": [0.8, 12.4, 12.89, 12.89],
    "payload__flat_spin_start": 357.0,
}
ANDOYA: dict[str, Any] = {
    "orbit__launch__latitude_deg": 69.29,
    "orbit__launch__longitude_deg": 16.02,
    "orbit__launch__azimuth_deg": 330.0,
    "orbit__launch__elevation_deg": 80.0,
    "orbit__launch__apogee": 169e3,
    "payload__axis_azimuth_deg": 330.0,
    "payload__axis_elevation_deg": 80.0,
    "payload__spin_hz": [5.45],
    "payload__coning_period": [0.2618],
    "payload__coning_angle_deg": [12.89],
}
STEADY: dict[str, Any] = {"payload__spin_hz": [5.45], "payload__flat_spin_start": 1e5}


def payload_values(**changes) -> Values:
    """Sections of a mission with a spinning payload on a ballistic arc."""
    given = {"orbit__source": "ballistic", "mission__epoch": EPOCH, **ANDOYA, **changes}
    return default_values((*MISSION, *ORBIT, *PAYLOAD, *SLITS), **given)


def motion_of(case: int = 0, **changes) -> PayloadMotion:
    """Motion of a case."""
    return payload_motion(payload_values(**changes), EPOCH_NS, random_key(1, case))


def sun_over_andoya():
    """Direction to the Sun in n."""
    return at(build_ephemeris(mission_orbit(payload_values()), EPOCH_NS, span_s=400.0, field=False), 100.0).sun_n


def sun_angles(motion: PayloadMotion, times, sun_n) -> np.ndarray:
    """(M,) true Sun angles [rad] at times [s]."""
    return np.array([np.arcsin((np.array(payload_state(motion, t).dcm_bn) @ sun_n)[2]) for t in times])


def pulses_of(motion: PayloadMotion, sun_n, start: float, end: float, frequency: float = 1e6, **slits):
    """Slit, 32-bit count and head of every pulse of a perfect timer between two times [s]."""
    geometry = slit_geometry(payload_values(**slits))
    room = 200_000
    times, codes, heads = np.zeros(room), np.zeros(room, dtype=np.int64), np.zeros(room, dtype=np.int64)
    count = slit_crossings(motion, geometry, sun_n, start, end, times, codes, heads)
    ticks = np.floor(times[:count] * frequency).astype(np.int64) % 2**32
    return list(zip(codes[:count].tolist(), ticks.tolist(), heads[:count].tolist(), strict=True))


def record_of(motion: PayloadMotion, sun_n, start: float, end: float, **slits) -> SlitRecord:
    """The passages that flight software finds in these pulses."""
    values = default_values((*SLITS, *slit_measurement.PARAMETERS), **slits)
    azimuths = np.radians(values.slits.head_azimuths_deg)
    return read_record(slit_measurement.parameters(values), pulses_of(motion, sun_n, start, end, **slits), azimuths)
