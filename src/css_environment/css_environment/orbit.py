# SPDX-License-Identifier: Apache-2.0
"""Orbits at many times: Keplerian elements with the secular drift of J2 or integrated under it, or a TLE.

Frame n is the mean equator and equinox of J2000 (its 0.02 arcsec bias to the ICRS is ignored).
"""

import math
from functools import lru_cache
from typing import NamedTuple

import erfa
import numpy as np

from css_environment.constants import EARTH_J2, EARTH_MU, EARTH_RADIUS
from css_environment.j2_integration import J2Track
from css_environment.time_scales import terrestrial_date, utc_date


class KeplerianOrbit(NamedTuple):
    """Elements at the epoch of the mission, mean equator of J2000; angles in radians."""

    semi_major_axis: float  # [m]
    eccentricity: float  # [-] in [0, 1)
    inclination: float
    raan: float  # right ascension of the ascending node
    argument_of_perigee: float
    true_anomaly: float
    j2: float  # [-] second zonal harmonic that drives the drift; 0 for a two-body orbit


class TleOrbit(NamedTuple):
    """A two-line element set, propagated by SGP4."""

    line1: str
    line2: str


class IntegratedOrbit(NamedTuple):
    """Motion under the Earth's gravity with J2, integrated; the elements are osculating at the epoch."""

    elements: KeplerianOrbit  # of the two-body orbit that has the same position and velocity at the epoch


class ArcsOrbit(NamedTuple):
    """One integrated orbit after the other; the first holds before its time as well."""

    starts_s: tuple[float, ...]  # after the epoch, growing: when each begins to hold, and its elements are osculating
    arcs: tuple[IntegratedOrbit, ...]


Orbit = KeplerianOrbit | IntegratedOrbit | TleOrbit | ArcsOrbit


def keplerian_orbit(
    semi_major_axis_m: float,
    eccentricity: float = 0.0,
    inclination_deg: float = 0.0,
    raan_deg: float = 0.0,
    argument_of_perigee_deg: float = 0.0,
    true_anomaly_deg: float = 0.0,
    j2_drift: bool = False,
) -> KeplerianOrbit:
    """Orbit from elements in mission units. Raises ValueError when they do not describe an ellipse."""
    if not (semi_major_axis_m > 0.0 and 0.0 <= eccentricity < 1.0):
        raise ValueError(
            "an orbit needs a semi-major axis > 0 and an eccentricity in [0, 1), "
            f"got {semi_major_axis_m} m and {eccentricity}"
        )
    return KeplerianOrbit(
        semi_major_axis_m,
        eccentricity,
        math.radians(inclination_deg),
        math.radians(raan_deg),
        math.radians(argument_of_perigee_deg),
        math.radians(true_anomaly_deg),
        EARTH_J2 if j2_drift else 0.0,
    )


def orbit_states(orbit: Orbit, epoch_ns: int, elapsed_s) -> tuple[np.ndarray, np.ndarray]:
    """Position [m] and velocity [m/s] in n, each (T, 3), at (T,) seconds after the epoch (UTC, ns)."""
    elapsed_s = np.atleast_1d(np.asarray(elapsed_s, dtype=float))
    if isinstance(orbit, TleOrbit):
        return _tle_states(orbit, epoch_ns, elapsed_s)
    if isinstance(orbit, ArcsOrbit):
        return _arcs_states(orbit, epoch_ns, elapsed_s)
    if isinstance(orbit, IntegratedOrbit):
        return _track(orbit).states(elapsed_s)
    return _keplerian_states(orbit, elapsed_s)


def _arcs_states(orbit: ArcsOrbit, epoch_ns: int, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    r_n, v_n = np.empty((len(t), 3)), np.empty((len(t), 3))
    which = np.maximum(np.searchsorted(orbit.starts_s, t, side="right") - 1, 0)
    for k in np.unique(which).tolist():
        rows = which == k
        r_n[rows], v_n[rows] = orbit_states(orbit.arcs[k], epoch_ns, t[rows] - orbit.starts_s[k])
    return r_n, v_n


@lru_cache(maxsize=16)
def _track(orbit: IntegratedOrbit) -> J2Track:
    r_n, v_n = _keplerian_states(orbit.elements._replace(j2=0.0), np.zeros(1))
    return J2Track(r_n[0], v_n[0])


def secular_rates(orbit: KeplerianOrbit) -> tuple[float, float, float]:
    """Mean motion, drift of the node and of the perigee [rad/s] to first order in J2 (Vallado, sec. 9.6)."""
    e2 = orbit.eccentricity**2
    n = math.sqrt(EARTH_MU / orbit.semi_major_axis**3)
    factor = 0.75 * n * orbit.j2 * (EARTH_RADIUS / (orbit.semi_major_axis * (1.0 - e2))) ** 2
    cos_i = math.cos(orbit.inclination)
    mean_motion = n + factor * math.sqrt(1.0 - e2) * (3.0 * cos_i**2 - 1.0)
    return mean_motion, -2.0 * factor * cos_i, factor * (5.0 * cos_i**2 - 1.0)


def _keplerian_states(orbit: KeplerianOrbit, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The velocity is the exact derivative of the drifting position."""
    a, e = orbit.semi_major_axis, orbit.eccentricity
    mean_motion, raan_rate, perigee_rate = secular_rates(orbit)
    ellipse = math.sqrt(1.0 - e * e)
    anomaly_0 = math.atan2(ellipse * math.sin(orbit.true_anomaly), e + math.cos(orbit.true_anomaly))
    anomaly = eccentric_anomaly(anomaly_0 - e * math.sin(anomaly_0) + mean_motion * t, e)
    cos_e, sin_e = np.cos(anomaly), np.sin(anomaly)
    rate = mean_motion / (1.0 - e * cos_e)
    x, y = a * (cos_e - e), a * ellipse * sin_e
    vx, vy = -a * sin_e * rate, a * ellipse * cos_e * rate

    raan = orbit.raan + raan_rate * t
    perigee = orbit.argument_of_perigee + perigee_rate * t
    cos_o, sin_o = np.cos(raan), np.sin(raan)
    cos_w, sin_w = np.cos(perigee), np.sin(perigee)
    cos_i, sin_i = math.cos(orbit.inclination), math.sin(orbit.inclination)
    # Unit vectors along the perigee, along the semi-latus rectum and along the orbit normal.
    p = np.stack((cos_o * cos_w - sin_o * sin_w * cos_i, sin_o * cos_w + cos_o * sin_w * cos_i, sin_w * sin_i), 1)
    q = np.stack((-cos_o * sin_w - sin_o * cos_w * cos_i, -sin_o * sin_w + cos_o * cos_w * cos_i, cos_w * sin_i), 1)
    w = np.stack((sin_o * sin_i, -cos_o * sin_i, np.full_like(t, cos_i)), 1)
    r_n = x[:, None] * p + y[:, None] * q
    v_n = vx[:, None] * p + vy[:, None] * q
    v_n += np.cross(perigee_rate * w + np.array([0.0, 0.0, raan_rate]), r_n)
    return r_n, v_n


def eccentric_anomaly(mean_anomaly, eccentricity: float) -> np.ndarray:
    """Root E of Kepler's equation M = E - e sin E [rad], by Newton's method from a start that converges."""
    turns = 2.0 * np.pi * np.round(np.asarray(mean_anomaly, dtype=float) / (2.0 * np.pi))
    m = mean_anomaly - turns
    anomaly = np.where(eccentricity > 0.8, np.copysign(np.pi, m), m + eccentricity * np.sin(m))
    for _ in range(50):
        step = (anomaly - eccentricity * np.sin(anomaly) - m) / (1.0 - eccentricity * np.cos(anomaly))
        anomaly = anomaly - step
        if np.all(np.abs(step) < 1e-13):
            break
    return anomaly + turns


def _tle_states(orbit: TleOrbit, epoch_ns: int, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    from sgp4.api import SGP4_ERRORS, Satrec  # here: most missions give elements and need no SGP4

    satellite = Satrec.twoline2rv(orbit.line1, orbit.line2)
    days, fraction = utc_date(epoch_ns, t)
    errors, r_teme, v_teme = satellite.sgp4_array(np.full_like(t, days), fraction)
    if errors.any():
        first = int(np.argmax(errors != 0))
        raise ValueError(f"SGP4 fails {t[first]} s after the epoch: {SGP4_ERRORS[int(errors[first])]}")
    dcm = dcm_n_teme(epoch_ns, t)
    return 1e3 * np.einsum("tij,tj->ti", dcm, r_teme), 1e3 * np.einsum("tij,tj->ti", dcm, v_teme)


def dcm_n_teme(epoch_ns: int, elapsed_s: np.ndarray) -> np.ndarray:
    """(T, 3, 3) rotation from SGP4's frame (true equator, mean equinox of date) to J2000.

    IAU 1976 precession and 1980 nutation, the models TEME belongs to (Vallado et al. 2006, AIAA 2006-6753).
    """
    tt = terrestrial_date(epoch_ns, elapsed_s)
    mean_to_true_equinox = erfa.rz(-erfa.eqeq94(*tt), np.broadcast_to(np.eye(3), (len(elapsed_s), 3, 3)))
    return np.einsum("tji,tjk->tik", erfa.pnm80(*tt), mean_to_true_equinox)
