# SPDX-License-Identifier: Apache-2.0
"""Ballistic arcs: the ellipse on which a body coasts that leaves a place on Earth towards a given apogee.

No burn and no air: the arc of a sounding rocket is fitted to the apogee that its flight report states.
"""

import math
from typing import NamedTuple

import erfa
import numpy as np

from css_common.vectors import (
    Mat3,
    Vec3,
    add,
    cross,
    dot,
    multiply,
    multiply_transposed,
    norm,
    scale,
    subtract,
    vector_of,
)
from css_environment.constants import EARTH_MU, EARTH_ROTATION_RATE
from css_environment.earth_rotation import dcm_en_at
from css_environment.orbit import KeplerianOrbit, orbit_states

_WGS84 = 1
_FASTEST = 9e3  # [m/s] beyond it the arc would leave the Earth


class Launch(NamedTuple):
    """Where and how an arc begins; angles in radians."""

    latitude: float  # geodetic, WGS 84
    longitude: float  # east
    height: float  # [m] above the ellipsoid
    azimuth: float  # of the start, from north over east, relative to the ground
    elevation: float
    apogee: float  # [m] height above the ellipsoid


def local_axes_e(latitude: float, longitude: float) -> Mat3:
    """Rows north, east and down in the Earth-fixed frame, at a geodetic place [rad]."""
    sin_b, cos_b, sin_l, cos_l = math.sin(latitude), math.cos(latitude), math.sin(longitude), math.cos(longitude)
    return (
        (-sin_b * cos_l, -sin_b * sin_l, cos_b),
        (-sin_l, cos_l, 0.0),
        (-cos_b * cos_l, -cos_b * sin_l, -sin_b),
    )


def local_direction_n(launch: Launch, epoch_ns: int, azimuth: float, elevation: float) -> Vec3:
    """Unit vector in n of a direction [rad] at the launch site, at the epoch (UTC, ns)."""
    horizontal = math.cos(elevation)
    ned = (horizontal * math.cos(azimuth), horizontal * math.sin(azimuth), -math.sin(elevation))
    direction_e = multiply_transposed(local_axes_e(launch.latitude, launch.longitude), ned)
    return multiply_transposed(dcm_en_at(epoch_ns), direction_e)


def geodetic_heights(epoch_ns: int, elapsed_s: np.ndarray, r_n: np.ndarray) -> np.ndarray:
    """(T,) heights above the ellipsoid [m] of positions (T, 3) [m] at (T,) seconds after the epoch."""
    r_e = [multiply(dcm_en_at(epoch_ns, t), vector_of(r)) for t, r in zip(elapsed_s, r_n, strict=True)]
    return erfa.gc2gd(_WGS84, np.array(r_e))[2]


def ballistic_arc(launch: Launch, epoch_ns: int) -> KeplerianOrbit:
    """The ellipse that leaves the launch site at the epoch and just reaches the apogee.

    Raises:
        ValueError: the apogee is not above the site, or no arc in this direction reaches it.
    """
    if not launch.apogee > launch.height:
        raise ValueError(f"an apogee of {launch.apogee:g} m is not above a launch site at {launch.height:g} m")
    dcm_en = dcm_en_at(epoch_ns)
    site_e = vector_of(erfa.gd2gc(_WGS84, launch.longitude, launch.latitude, launch.height))
    r_n = multiply_transposed(dcm_en, site_e)
    ground_v = cross(scale(EARTH_ROTATION_RATE, dcm_en[2]), r_n)
    direction = local_direction_n(launch, epoch_ns, launch.azimuth, launch.elevation)

    def excess(speed: float) -> float:
        orbit, time = _through(r_n, add(ground_v, scale(speed, direction)))
        position, _ = orbit_states(orbit, epoch_ns, time)
        return float(geodetic_heights(epoch_ns, np.array([time]), position)[0]) - launch.apogee

    try:
        from scipy.optimize import brentq  # half a second to load, for the few that fly a ballistic arc

        speed = brentq(excess, 1.0, _FASTEST, xtol=1e-9)
    except ValueError as error:
        raise ValueError(f"no arc in this direction has its apogee at {launch.apogee:g} m") from error
    return _through(r_n, add(ground_v, scale(speed, direction)))[0]


def _through(r_n: Vec3, v_n: Vec3) -> tuple[KeplerianOrbit, float]:
    """The ellipse through a position and velocity, and the time [s] from there to its apogee (Vallado, sec. 2.5)."""
    r = norm(r_n)
    a = 1.0 / (2.0 / r - dot(v_n, v_n) / EARTH_MU)
    if not a > 0.0:
        raise ValueError("the velocity is beyond that of escape")
    h = cross(r_n, v_n)
    e = subtract(scale(1.0 / EARTH_MU, cross(v_n, h)), scale(1.0 / r, r_n))
    eccentricity = norm(e)
    node: Vec3 = (-h[1], h[0], 0.0) if h[0] != 0.0 or h[1] != 0.0 else (1.0, 0.0, 0.0)
    radial = dot(r_n, v_n)

    def about_h(start: Vec3, end: Vec3) -> float:
        return math.atan2(dot(cross(start, end), h) / norm(h), dot(start, end))

    orbit = KeplerianOrbit(
        semi_major_axis=a,
        eccentricity=eccentricity,
        inclination=math.atan2(math.hypot(h[0], h[1]), h[2]),
        raan=math.atan2(node[1], node[0]),
        argument_of_perigee=about_h(node, e),
        true_anomaly=about_h(e, r_n),
        j2=0.0,
    )
    anomaly = math.atan2(radial / math.sqrt(EARTH_MU * a), 1.0 - r / a) % (2.0 * math.pi)
    mean_anomaly = anomaly - eccentricity * math.sin(anomaly)
    return orbit, (math.pi - mean_anomaly) * math.sqrt(a**3 / EARTH_MU)
