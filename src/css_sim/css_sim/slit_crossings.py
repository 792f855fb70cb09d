# SPDX-License-Identifier: Apache-2.0
"""When the Sun crosses the slits of a spinning payload (Reichard et al., ESPRIT, Figs. 1 to 3).

The three slits of a head meet in a point: the vertical one lies in the plane of the spin axis, the slanted ones at
an inclination i to it. The Sun at azimuth phi from the head and elevation SA is on a slit when sin phi is
+tan i tan SA (upper), 0 (vertical) or -tan i tan SA (lower), hence where it passes through a plane; for a Sun above
the equator the upper slit comes first. The instants are roots on the true motion, not samples of it.
"""

import math
from typing import NamedTuple

import numpy as np

from css_common.kernel import kernel
from css_common.schema import Values
from css_common.vectors import Vec3, multiply
from css_sensors.slits import FIELD_OF_VIEW, SLITS_PER_HEAD, head_azimuths, slit_inclination
from css_sim.spinning_payload import PayloadMotion, payload_state

_LARGEST_TURN = 0.2  # [rad] between two looks: no slit is crossed twice in it, unless the Sun leaves the view there
_RESOLUTION = 1e-13  # [s]


class SlitGeometry(NamedTuple):
    """Heads around the spin axis."""

    cos_azimuth: np.ndarray  # (H,)
    sin_azimuth: np.ndarray  # (H,)
    tan_inclination: float
    sin_half_view: float  # the slits are lit while |sin SA| is not above it


def slit_geometry(values: Values) -> SlitGeometry:
    """The heads of a mission (section slits)."""
    azimuths = np.asarray(head_azimuths(values))
    return SlitGeometry(
        np.cos(azimuths),
        np.sin(azimuths),
        math.tan(slit_inclination(values)),
        math.sin(math.radians(0.5 * values[FIELD_OF_VIEW])),
    )


@kernel
def sun_in_head(geometry: SlitGeometry, head: int, sun_b: Vec3) -> Vec3:
    """Direction to the Sun in axes of a head: x outward, z along the spin axis."""
    c, s = geometry.cos_azimuth[head], geometry.sin_azimuth[head]
    return (c * sun_b[0] + s * sun_b[1], c * sun_b[1] - s * sun_b[0], sun_b[2])


@kernel
def off_slit(geometry: SlitGeometry, slit: int, sun_h: Vec3) -> float:
    """How far the Sun is from the plane of a slit: zero on it, for a Sun on the head's side."""
    return sun_h[1] - (1 - slit) * geometry.tan_inclination * sun_h[2]


@kernel
def _sun_at(motion: PayloadMotion, geometry: SlitGeometry, head: int, sun_n: Vec3, time: float) -> Vec3:
    return sun_in_head(geometry, head, multiply(payload_state(motion, time).dcm_bn, sun_n))


@kernel
def _root(
    motion: PayloadMotion, geometry: SlitGeometry, head: int, slit: int, sun_n: Vec3, a: float, b: float
) -> float:
    """Instant between a and b at which the sign changes (regula falsi, Illinois variant)."""
    fa = off_slit(geometry, slit, _sun_at(motion, geometry, head, sun_n, a))
    fb = off_slit(geometry, slit, _sun_at(motion, geometry, head, sun_n, b))
    side = 0
    t = b
    for _ in range(100):
        if b - a <= _RESOLUTION:
            break
        t = (fa * b - fb * a) / (fa - fb)
        f = off_slit(geometry, slit, _sun_at(motion, geometry, head, sun_n, t))
        if f == 0.0:
            break
        if (f > 0.0) == (fb > 0.0):
            b, fb = t, f
            if side == -1:
                fa *= 0.5
            side = -1
        else:
            a, fa = t, f
            if side == 1:
                fb *= 0.5
            side = 1
        if abs(f) < 1e-15:
            break
    return t


@kernel
def slit_crossings(
    motion: PayloadMotion,
    geometry: SlitGeometry,
    sun_n: Vec3,
    start: float,
    end: float,
    times_out,
    slits_out,
    heads_out,
) -> int:
    """All crossings after `start`, up to and with `end` [s after the epoch], in the order of time.

    Args:
        sun_n: direction to the Sun, held over the interval (it turns by 1e-8 rad in 50 ms).
        times_out: (M,) instants [s after the epoch], written.
        slits_out: (M,) UPPER, VERTICAL or LOWER, written.
        heads_out: (M,) index of the head, written.

    Returns:
        Number of crossings; those beyond M are dropped.
    """
    count = 0
    looks = max(1, math.ceil(motion.fastest * (end - start) / _LARGEST_TURN))
    for look in range(looks):
        a = start + (end - start) * look / looks
        b = end if look == looks - 1 else start + (end - start) * (look + 1) / looks
        sun_a = multiply(payload_state(motion, a).dcm_bn, sun_n)
        sun_b = multiply(payload_state(motion, b).dcm_bn, sun_n)
        for head in range(geometry.cos_azimuth.shape[0]):
            from_a, from_b = sun_in_head(geometry, head, sun_a), sun_in_head(geometry, head, sun_b)
            if from_a[0] < -_LARGEST_TURN and from_b[0] < -_LARGEST_TURN:
                continue
            for slit in range(SLITS_PER_HEAD):
                if (off_slit(geometry, slit, from_a) > 0.0) == (off_slit(geometry, slit, from_b) > 0.0):
                    continue
                t = _root(motion, geometry, head, slit, sun_n, a, b)
                seen = _sun_at(motion, geometry, head, sun_n, t)
                if seen[0] <= 0.0 or abs(seen[2]) > geometry.sin_half_view or count == times_out.shape[0]:
                    continue
                at = count
                while at > 0 and times_out[at - 1] > t:
                    times_out[at], slits_out[at] = times_out[at - 1], slits_out[at - 1]
                    heads_out[at] = heads_out[at - 1]
                    at -= 1
                times_out[at], slits_out[at], heads_out[at] = t, slit, head
                count += 1
    return count
