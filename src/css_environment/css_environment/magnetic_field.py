# SPDX-License-Identifier: Apache-2.0
"""Geomagnetic main field: IGRF-14 (ppigrf), 1900 to 2030."""

import math
from datetime import UTC, datetime
from functools import lru_cache

import numpy as np

from css_environment.constants import EARTH_ROTATION_RATE

FIRST_YEAR, LAST_YEAR = 1900, 2030
"""Years at whose beginning the model begins and ends."""

HIGHEST_DEGREE = 13
"""Of the spherical harmonics of IGRF."""

# The surface to which the coefficients belong, and a low orbit's height above it [m].
_REFERENCE_RADIUS = 6_371_200.0
_LOW_ORBIT = 400e3


def field_along_orbit(
    r_n: np.ndarray, elapsed_s: np.ndarray, dcm_en, date_ns: int, degree: int = HIGHEST_DEGREE
) -> np.ndarray:
    """Field in n [T], (T, 3), at positions `r_n` [m], (T, 3).

    `dcm_en` is the rotation from n to e at elapsed time zero, from where the Earth turns with `elapsed_s`;
    `date_ns` (UTC, ns) fixes the secular variation, which is about 100 nT a year: one date does for a day. Beyond the
    years of the model the field is that of its first or last day.
    Harmonics beyond `degree` are left out, as a small flight computer may.
    """
    import ppigrf  # here: it loads pandas, which missions without a magnetometer need not wait for

    angle = EARTH_ROTATION_RATE * np.asarray(elapsed_s, dtype=float)
    cos_a, sin_a = np.cos(angle), np.sin(angle)
    x, y, z = np.asarray(dcm_en) @ np.asarray(r_n, dtype=float).T
    longitude = np.arctan2(y, x) - angle
    radius = np.sqrt(x * x + y * y + z * z)
    colatitude = np.arctan2(np.hypot(x, y), z)
    # On the axis the spherical components have no meaning: stay a millimetre away from it.
    colatitude = np.clip(colatitude, 1e-9, np.pi - 1e-9)
    up, south, east = ppigrf.igrf_gc(
        radius / 1e3,
        np.degrees(colatitude),
        np.degrees(longitude),
        _date_in_model(date_ns),
        max_degree=degree,
    )
    up, south, east = np.ravel(up), np.ravel(south), np.ravel(east)
    outward = up * np.sin(colatitude) + south * np.cos(colatitude)
    cos_l, sin_l = np.cos(longitude), np.sin(longitude)
    field_x = outward * cos_l - east * sin_l
    field_y = outward * sin_l + east * cos_l
    field_z = up * np.cos(colatitude) - south * np.sin(colatitude)
    # Back from the turned Earth to its orientation at elapsed time zero, then to n.
    field_e0 = np.stack((cos_a * field_x - sin_a * field_y, sin_a * field_x + cos_a * field_y, field_z), 1)
    return 1e-9 * field_e0 @ np.asarray(dcm_en)


@lru_cache
def omitted_field(degree: int, height: float = _LOW_ORBIT) -> float:
    """What a model leaves out that ends at `degree`: root mean square of each component over the sphere [T].

    By the spectrum of Lowes 1966, sum over n of (n + 1) (a / r)^(2 n + 4) sum over m of (g_nm^2 + h_nm^2), of the last
    main field of IGRF up to its highest degree, at a height [m] above the mean surface.
    """
    from ppigrf import ppigrf  # here: as above

    ratio = _REFERENCE_RADIUS / (_REFERENCE_RADIUS + height)
    g, h = (coefficients.iloc[-2] for coefficients in ppigrf.read_shc(ppigrf.shc_fn))
    power = sum((n + 1) * ratio ** (2 * n + 4) * (g[n, m] ** 2 + h[n, m] ** 2) for n, m in g.index if n > degree)
    return 1e-9 * math.sqrt(power / 3.0)


def _date_in_model(date_ns: int) -> datetime:
    date = datetime.fromtimestamp(date_ns / 1e9, tz=UTC).replace(tzinfo=None)
    return min(max(date, datetime(FIRST_YEAR, 1, 1)), datetime(LAST_YEAR, 1, 1))
