# SPDX-License-Identifier: Apache-2.0
"""What surrounded the spacecraft at each instant by time and place: Sun, shadow, field; the light of the mean Earth."""

from dataclasses import dataclass

import numpy as np

from css_calibration.recorded import Recorded
from css_common.kernel import kernel
from css_common.vectors import Mat3, row
from css_environment.albedo import Screen, albedo_output, new_workspace, plane_screen
from css_environment.constants import ASTRONOMICAL_UNIT
from css_environment.earth_light import EarthView, albedo_sources, new_earth_view, new_light
from css_environment.earth_rotation import advance_dcm_en, dcm_en_at
from css_environment.eclipse import conical_illumination
from css_environment.magnetic_field import field_along_orbit
from css_environment.reflectivity import zonal_reflectivity
from css_environment.sun import sun_positions
from css_sensors.cells import half_view_cosine, plane_sides

_DAY_S = 86_400.0
_WHOLE = 0.95  # of sunlight that nothing hides, at the Earth's farthest from the Sun
_CELL = np.dtype([(name, np.float64) for name in ("nx", "ny", "nz", "side")], align=True)


@dataclass
class Surroundings:
    """At M instants.

    Attributes:
        sun_n: (M, 3) unit vectors to the Sun; NaN where the place is unknown.
        intensity: (M,) of sunlight, 1 at 1 AU, less what the Earth hides; 1 where nothing is known.
        flux: (M,) of the Sun, 1 at 1 AU, whatever hides it.
        shadow: (M,) part of the Sun that the Earth hides, 0 to 1.
        field_n: (M, 3) geomagnetic field [T]; NaN where not asked for.
        dcm_en: (M, 3, 3) from n to the Earth-fixed frame.
    """

    sun_n: np.ndarray
    intensity: np.ndarray
    flux: np.ndarray
    shadow: np.ndarray
    field_n: np.ndarray
    dcm_en: np.ndarray


def surroundings_of(recorded: Recorded, *, with_field: bool) -> Surroundings:
    """Models at the instants of a recording; without a place the Sun is whole and at 1 AU."""
    count = len(recorded.stamp_ns)
    unknown = np.full((count, 3), np.nan)
    result = Surroundings(
        unknown, np.ones(count), np.ones(count), np.zeros(count), unknown.copy(), np.tile(np.eye(3), (count, 1, 1))
    )
    if recorded.r_n is None:
        if recorded.sunlight is not None:
            result.intensity = recorded.sunlight.copy()
            result.shadow = np.clip(1.0 - recorded.sunlight, 0.0, 1.0) * (recorded.sunlight < _WHOLE)
        return result
    epoch_ns = int(recorded.stamp_ns[0])
    elapsed = recorded.time
    placed = np.isfinite(recorded.r_n).all(axis=1)
    r_n = np.ascontiguousarray(recorded.r_n[placed])
    line = sun_positions(epoch_ns, elapsed[placed]) - r_n
    distance = np.linalg.norm(line, axis=1)
    sun_n = line / distance[:, None]
    illumination = np.empty(len(r_n))
    _illuminations(r_n, sun_n, distance, illumination)
    result.sun_n[placed] = sun_n
    result.shadow[placed] = 1.0 - illumination
    result.flux[placed] = (ASTRONOMICAL_UNIT / distance) ** 2
    result.intensity[placed] = illumination * result.flux[placed]
    # the date of a day does for field and precession within it
    days = (elapsed // _DAY_S).astype(np.int64)
    for day in np.unique(days[placed]):
        rows = np.flatnonzero(placed & (days == day))
        since = elapsed[rows] - day * _DAY_S
        date_ns = epoch_ns + int(day * _DAY_S * 1e9)
        dcm_en = dcm_en_at(date_ns)
        turned = np.empty((len(rows), 3, 3))
        _turned_earths(np.array(dcm_en), since, turned)
        result.dcm_en[rows] = turned
        if with_field:
            result.field_n[rows] = field_along_orbit(recorded.r_n[rows], since, dcm_en, date_ns)
    return result


def earth_light(recorded: Recorded, around: Surroundings, dcm_bn: np.ndarray, normals_b: np.ndarray) -> np.ndarray:
    """Light (M, N) of the mean Earth on cells [-] at attitudes (M, 3, 3); zero where attitude or place are unknown.

    Args:
        normals_b: (N, 3) where the cells look; what hides part of their sky follows the mission's normals.
    """
    albedo = np.zeros((len(recorded.stamp_ns), len(normals_b)))
    if recorded.r_n is None:
        return albedo
    values = recorded.mission.values
    cells = np.zeros(len(normals_b), _CELL)
    cells["nx"], cells["ny"], cells["nz"] = normals_b.T
    cells["side"] = plane_sides(values)
    known = np.isfinite(dcm_bn).all(axis=(1, 2)) & np.isfinite(around.sun_n).all(axis=1)
    rows = np.flatnonzero(known & (around.shadow < 1.0))
    out = np.zeros((len(rows), len(normals_b)))
    _earth_light(
        new_earth_view(),
        new_light(),
        new_workspace(),
        np.ascontiguousarray(recorded.r_n[rows]),
        np.ascontiguousarray(around.sun_n[rows]),
        around.flux[rows],
        around.dcm_en[rows],
        zonal_reflectivity(1).mean,
        cells,
        plane_screen(values.cells.clip_normal),
        half_view_cosine(values),
        np.ascontiguousarray(dcm_bn[rows]),
        out,
    )
    albedo[rows] = out
    return albedo


@kernel
def _illuminations(r_n, sun_n, distance, out) -> None:
    for k in range(out.shape[0]):
        out[k] = conical_illumination(row(r_n, k), row(sun_n, k), distance[k])


@kernel
def _mat3(m, k: int) -> Mat3:
    return (
        (m[k, 0, 0], m[k, 0, 1], m[k, 0, 2]),
        (m[k, 1, 0], m[k, 1, 1], m[k, 1, 2]),
        (m[k, 2, 0], m[k, 2, 1], m[k, 2, 2]),
    )


@kernel
def _turned_earths(dcm_en, since_s, out) -> None:
    start = (
        (dcm_en[0, 0], dcm_en[0, 1], dcm_en[0, 2]),
        (dcm_en[1, 0], dcm_en[1, 1], dcm_en[1, 2]),
        (dcm_en[2, 0], dcm_en[2, 1], dcm_en[2, 2]),
    )
    for k in range(out.shape[0]):
        turned = advance_dcm_en(start, since_s[k])
        for i in range(3):
            for j in range(3):
                out[k, i, j] = turned[i][j]


@kernel
def _earth_light(
    view: EarthView,
    light,
    work,
    r_n,
    sun_n,
    flux,
    dcm_en,
    reflectivity,
    cells,
    screen: Screen,
    cos_half_view: float,
    dcm_bn,
    out,
) -> None:
    for k in range(out.shape[0]):
        albedo_sources(view, row(r_n, k), row(sun_n, k), flux[k], _mat3(dcm_en, k), reflectivity, light)
        albedo_output(light, cells, screen, cos_half_view, _mat3(dcm_bn, k), work, out[k])
