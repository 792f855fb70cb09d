# SPDX-License-Identifier: Apache-2.0
"""What a Sun estimator's own models say at each of many steps, as tables that compiled loops read."""

from collections.abc import Sequence

import numpy as np

from css_common.kernel import outer_kernel
from css_environment.earth_light import new_light
from css_estimation.sun import flight_sky
from css_estimation.sun.flight_sky import FlightSky
from css_estimation.sun.sun_heading import Sky

SKY = np.dtype(
    [
        ("known", np.bool_),
        ("predicted", np.int64),
        ("sun_n", np.float64, 3),
        ("solar_flux", np.float64),
        ("illumination", np.float64),
        ("r_n", np.float64, 3),
        ("field_n", np.float64, 3),
    ],
    align=True,
)
"""`css_estimation.sun.sun_heading.Sky` of one step, without the light of the Earth."""


def sky_table(sky: FlightSky | None, stamps_ns: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """What the models say at stamps [ns of UTC].

    Returns:
        (K,) of SKY, (1,) without models; (K, 192) light of the Earth by them, (1, 192) when they predict none.
    """
    rows = 1 if sky is None else len(stamps_ns)
    skies = np.zeros(rows, SKY)
    light = aligned_table(rows if sky is not None and sky.has_light else 1, len(new_light()))
    for k in range(rows):
        *row, now = flight_sky.sky_at(sky, stamps_ns[k])
        skies[k] = tuple(row)
        if k < len(light):
            light[k] = now
    return skies, light


@outer_kernel
def sky_at(table, light, k: int) -> Sky:
    """What the models say at a step, of the tables that `sky_table` gives."""
    s = table[min(k, table.shape[0] - 1)]
    return Sky(
        s.known,
        s.predicted,
        (s.sun_n[0], s.sun_n[1], s.sun_n[2]),
        s.solar_flux,
        s.illumination,
        (s.r_n[0], s.r_n[1], s.r_n[2]),
        (s.field_n[0], s.field_n[1], s.field_n[2]),
        light[min(k, light.shape[0] - 1)],
    )


def aligned_table(rows: int, columns: int) -> np.ndarray:
    """Zeros (rows, columns) float32 whose rows begin on cache lines when a row fills whole ones."""
    raw = np.zeros(4 * rows * columns + 64, np.uint8)
    start = -raw.ctypes.data % 64
    return raw[start : start + 4 * rows * columns].view(np.float32).reshape(rows, columns)
