# SPDX-License-Identifier: Apache-2.0
"""Power of solar panels with reflectors over the angle to the Sun.

Benton has words alone: small panels, reflectors that focus light onto them, and power that drops more quickly than
without. The model is a choice: two plane mirrors along opposite edges, as long as the panel is wide, leaning out by
30 deg from its normal. Facing the Sun they double the light, the outermost ray of each mirror just reaching the
opposite edge. Mirrors reflect 85 %. The Sun moves in the plane across the mirrors, the worst one. Rays that enter
between the mirrors' edges are followed to the panel or out.
"""

import math

import numpy as np

LEAN = math.radians(30.0)
REFLECTANCE = 0.85
_RAYS = 4001
_BOUNCES = 4
_PANEL, _LEFT, _RIGHT, _OUT = range(4)


def reflector_power(angle: float) -> float:
    """Power relative to a panel without reflectors that faces the Sun.

    Args:
        angle: of the panel normal to the Sun [rad], in the plane across the mirrors.
    """
    if abs(angle) >= 0.5 * math.pi:
        return 0.0
    rim, height = 0.5 + math.sin(LEAN), math.cos(LEAN)
    # in the middle of equal parts of the opening
    x = rim * (2.0 * (np.arange(_RAYS) + 0.5) / _RAYS - 1.0)
    y = np.full(_RAYS, height)
    dx, dy = np.full(_RAYS, -math.sin(angle)), np.full(_RAYS, -math.cos(angle))
    light = np.full(_RAYS, 2.0 * rim * math.cos(angle) / _RAYS)
    absorbed = 0.0
    last = np.full(_RAYS, _OUT)
    for _ in range(_BOUNCES + 1):
        hit, reach = _first_hit(x, y, dx, dy, last)
        absorbed += float(light[hit == _PANEL].sum())
        goes_on = (hit == _LEFT) | (hit == _RIGHT)
        x, y, dx, dy, light, last, reach = (
            a[goes_on] for a in (x + reach * dx, y + reach * dy, dx, dy, light, hit, reach)
        )
        side = np.where(last == _RIGHT, 1.0, -1.0)
        tx, ty = side * math.sin(LEAN), math.cos(LEAN)
        along = dx * tx + dy * ty
        dx, dy = 2.0 * along * tx - dx, 2.0 * along * ty - dy
        light = REFLECTANCE * light
    return absorbed


def _first_hit(
    x: np.ndarray, y: np.ndarray, dx: np.ndarray, dy: np.ndarray, last: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """What each ray meets first, and how far on; a ray does not meet the mirror that it comes from."""
    hit, reach = np.full(len(x), _OUT), np.full(len(x), math.inf)
    ends = {
        _PANEL: ((-0.5, 0.0), (1.0, 0.0)),
        _LEFT: ((-0.5, 0.0), (-math.sin(LEAN), math.cos(LEAN))),
        _RIGHT: ((0.5, 0.0), (math.sin(LEAN), math.cos(LEAN))),
    }
    for surface, ((px, py), (tx, ty)) in ends.items():
        # p + s t = ray + r d
        across = dx * ty - dy * tx
        with np.errstate(divide="ignore", invalid="ignore"):
            r = ((px - x) * ty - (py - y) * tx) / across
            s = ((px - x) * dy - (py - y) * dx) / across
        nearer = (last != surface) & (r >= 0.0) & (s >= 0.0) & (s <= 1.0) & (r < reach)
        hit[nearer], reach[nearer] = surface, r[nearer]
    return hit, np.where(np.isfinite(reach), reach, 0.0)


def power_curve(angles: np.ndarray) -> np.ndarray:
    """(A,) power at angles [rad], relative to the same panel facing the Sun."""
    facing = reflector_power(0.0)
    return np.array([reflector_power(float(angle)) / facing for angle in angles])
