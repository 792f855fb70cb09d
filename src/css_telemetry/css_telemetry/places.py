# SPDX-License-Identifier: Apache-2.0
"""Positions of a table in n (mean equator J2000), from those in Earth-fixed, geodetic or TEME components."""

from typing import NamedTuple

import erfa
import numpy as np

from css_environment.constants import EARTH_ROTATION_RATE
from css_environment.earth_rotation import dcm_en_at
from css_environment.orbit import dcm_n_teme
from css_telemetry.columns import Readings
from css_telemetry.description import PositionForm
from css_telemetry.faults import Broken

_SEGMENT_NS = 21_600 * 10**9  # precession of 0.04 arcsec is not followed within it
_WGS84 = 1
_LEAST_RADIUS, _MOST_RADIUS = 6.2e6, 1e9  # [m]


class Place(NamedTuple):
    """Where the spacecraft was, NaN where that is not known."""

    r_n: np.ndarray  # (N, 3) [m]
    v_n: np.ndarray  # (N, 3) [m/s], NaN everywhere when no velocity was given


def place_of(readings: Readings, form: PositionForm) -> Place:
    """Positions of all lines; those that are no distance from the Earth's centre are counted and left out."""
    given = readings.matrix(form.columns)
    count = len(given)
    velocity = np.full((count, 3), np.nan)
    if form.velocity:
        velocity = readings.matrix(form.velocity) * form.velocity_factor
    position = _geodetic(given, form) if form.frame == "geodetic" else given * form.factor
    radius = np.linalg.norm(position, axis=1)
    bad = np.isfinite(radius) & ~((radius > _LEAST_RADIUS) & (radius < _MOST_RADIUS))
    detail = f"columns {', '.join(form.columns)}: no place of a spacecraft, check frame and unit"
    for index in np.flatnonzero(bad).tolist():
        readings.account.repair(int(readings.lines[index]), Broken("no place of a spacecraft", detail))
    position[bad] = np.nan
    known = np.flatnonzero(np.isfinite(position).all(axis=1))
    r_n, v_n = np.full((count, 3), np.nan), np.full((count, 3), np.nan)
    if len(known):
        stamps = readings.stamps_ns[known]
        r_n[known], v_n[known] = _in_n(position[known], velocity[known], stamps, form.frame)
    return Place(r_n, v_n)


def _geodetic(given: np.ndarray, form: PositionForm) -> np.ndarray:
    """Earth-fixed positions of latitude, longitude (east) and height above the WGS 84 ellipsoid."""
    latitude, longitude = given[:, 0] * form.angle_factor, given[:, 1] * form.angle_factor
    height = given[:, 2] * form.factor
    usable = np.isfinite(given).all(axis=1) & (np.abs(latitude) <= np.pi / 2 + 1e-9)
    position = np.full((len(given), 3), np.nan)
    position[usable] = erfa.gd2gc(_WGS84, longitude[usable], latitude[usable], height[usable])
    # a latitude beyond the pole is no place: at the Earth's centre it is refused as such
    position[np.isfinite(given).all(axis=1) & ~usable] = 0.0
    return position


def _in_n(
    position: np.ndarray, velocity: np.ndarray, stamps_ns: np.ndarray, frame: str
) -> tuple[np.ndarray, np.ndarray]:
    if frame == "eci":
        return position, velocity
    if frame == "teme":
        begin = int(stamps_ns[0])
        dcm = dcm_n_teme(begin, (stamps_ns - begin) * 1e-9)
        return np.einsum("tij,tj->ti", dcm, position), np.einsum("tij,tj->ti", dcm, velocity)
    return _from_earth(position, velocity, stamps_ns)


def _from_earth(position: np.ndarray, velocity: np.ndarray, stamps_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """From the Earth-fixed frame, which turns: a segment at a time, about the pole within it."""
    r_n, v_n = np.empty_like(position), np.empty_like(velocity)
    segments = stamps_ns // _SEGMENT_NS
    spin = np.array([0.0, 0.0, EARTH_ROTATION_RATE])
    inertial = velocity + np.cross(spin, position)
    for segment in np.unique(segments):
        rows = np.flatnonzero(segments == segment)
        begin = int(segment) * _SEGMENT_NS
        dcm_ne = np.array(dcm_en_at(begin)).T
        angle = EARTH_ROTATION_RATE * (stamps_ns[rows] - begin) * 1e-9
        r_n[rows] = _turned(position[rows], angle) @ dcm_ne.T
        v_n[rows] = _turned(inertial[rows], angle) @ dcm_ne.T
    return r_n, v_n


def _turned(vectors: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Components (K, 3) in the Earth-fixed frame of the segment's beginning, of those `angle` later."""
    c, s = np.cos(angle), np.sin(angle)
    x, y = vectors[:, 0], vectors[:, 1]
    return np.stack((c * x - s * y, s * x + c * y, vectors[:, 2]), axis=1)
