# SPDX-License-Identifier: Apache-2.0
"""The sunlit Earth as a few patches of light seen from a spacecraft: what `albedo` sums over.

The disc of the Earth is divided into 32 patches in rings about nadir. Fine samples, refined toward the limb, give
each patch its light, its mean direction and its angular size, so that the terminator and the grid of reflectivities
are resolved finer than the patches. In the integrand of O'Keefe & Schaub 2013, Eq. 17,

    alpha / pi (n_A.s) (n_A.r_AB) dA / |r_AB|^2 = alpha / pi (n_A.s) dOmega,

dOmega is the solid angle that dA fills seen from the spacecraft.
"""

import math
from typing import NamedTuple

import numpy as np

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, cross, dot, multiply, norm, scale, subtract, unit
from css_environment.constants import EARTH_RADIUS
from css_environment.reflectivity import cell_at

PATCHES = 32

# Patches of each ring, where the rings end (fraction of the disc's solid angle), and how many samples a patch has
# from nadir outward and around: the division that gave the least error with 32 patches.
_SECTORS = (5, 11, 16)
_RING_ENDS = (0.17, 0.56, 1.0)
_OUTWARD = (6, 6, 8)
_AROUND = (8, 6, 5)

_CIRCLES = sum(_OUTWARD)
_SAMPLES = sum(s * o * a for s, o, a in zip(_SECTORS, _OUTWARD, _AROUND, strict=True))
_AZIMUTHS = np.concatenate(
    [2.0 * np.pi * (np.arange(s * a) + 0.5) / (s * a) for s, a in zip(_SECTORS, _AROUND, strict=True)]
)
_COS_AZIMUTH, _SIN_AZIMUTH = np.cos(_AZIMUTHS), np.sin(_AZIMUTHS)

# Rows of a table of light, and places in its last row.
X, Y, Z, LIGHT, SIZE, DISC = range(0, 6 * PATCHES, PATCHES)
DISC_COS, DISC_SIN, DISC_LIGHT = 3, 4, 5

_SMALLEST_SIZE = 0.01


class EarthView(NamedTuple):
    """What depends on place and time only, so that cases with different reflectivities can share it."""

    frame: np.ndarray  # (3, 3) rows in n: azimuth of the Sun, across it, up
    circles: np.ndarray  # (2, circles) sine and cosine of the angle from nadir of each circle of samples
    light: np.ndarray  # (samples,) light of each sample at a reflectivity of one
    cell: np.ndarray  # (samples,) its cell in the reflectivity grid
    disc: np.ndarray  # (3,) cosine and sine of the angular radius of the Earth; 1 if any of it is sunlit, else 0


def new_earth_view() -> EarthView:
    """Room for `look_at_earth`."""
    return EarthView(
        np.zeros((3, 3)), np.zeros((2, _CIRCLES)), np.zeros(_SAMPLES), np.zeros(_SAMPLES, np.int32), np.zeros(3)
    )


def new_light() -> np.ndarray:
    """Room for the patches of `albedo_sources`: (192,) float32, six rows of 32 at the offsets X to DISC.

    Rows: mean direction from the spacecraft in n (three; shorter than one by the spread of the patch), light / (4 size)
    with light relative to the Sun at 1 AU, size (angular half width [rad]). The last row holds the unit vector to
    nadir, cosine and sine of the Earth's angular radius, and the light of all patches.
    """
    return aligned_rows(6)


def aligned_rows(rows: int) -> np.ndarray:
    """Zeros, (32 rows,) float32, that begin on a cache line: vector loads then never straddle two.

    The rows lie in one dimension because the compiler then sees that they do not overlap.
    """
    size = 4 * rows * PATCHES
    raw = np.zeros(size + 64, np.uint8)
    start = -raw.ctypes.data % 64
    return raw[start : start + size].view(np.float32)


@kernel
def albedo_sources(
    view: EarthView, r_n: Vec3, sun_n: Vec3, solar_flux: float, dcm_en: Mat3, reflectivity, light
) -> None:
    """Patches of light of the Earth at one instant.

    Args:
        view: room to work in, from `new_earth_view`.
        r_n: position from the centre of the Earth [m].
        sun_n: unit vector to the Sun.
        solar_flux: relative to 1 AU.
        dcm_en: rotation from n to the Earth-fixed frame.
        reflectivity: (rows, columns) grid, see the module `reflectivity`.
        light: written, see `new_light`.
    """
    look_at_earth(view, r_n, sun_n, solar_flux, dcm_en, reflectivity.shape[0], reflectivity.shape[1])
    gather_light(view, reflectivity, light)


@kernel
def look_at_earth(
    view: EarthView, r_n: Vec3, sun_n: Vec3, solar_flux: float, dcm_en: Mat3, rows: int, columns: int
) -> None:
    """First half of `albedo_sources`: geometry and sunlight of the samples on a grid of rows and columns."""
    ratio = EARTH_RADIUS / max(norm(r_n), 1.0001 * EARTH_RADIUS)
    disc_cos = math.sqrt(1.0 - ratio * ratio)
    view.disc[0], view.disc[1] = disc_cos, ratio
    up, x, y = upright_frame(r_n, sun_n)
    for i in range(3):
        view.frame[0, i], view.frame[1, i], view.frame[2, i] = x[i], y[i], up[i]
    up_e, x_e, y_e = multiply(dcm_en, up), multiply(dcm_en, x), multiply(dcm_en, y)
    sun_up, sun_x = dot(sun_n, up), dot(sun_n, x)
    # The terminator lies 90 deg from the point below the Sun, the horizon at the arc cosine of `ratio` from the
    # point below the spacecraft.
    view.disc[2] = 1.0 if sun_up > -disc_cos else 0.0
    if view.disc[2] == 0.0:
        return

    sample, circle, azimuth, end = 0, 0, 0, 0.0
    for ring in range(len(_SECTORS)):
        points = _SECTORS[ring] * _AROUND[ring]
        first, last = _emission_cos(end, disc_cos, ratio), _emission_cos(_RING_ENDS[ring], disc_cos, ratio)
        end = _RING_ENDS[ring]
        step = (last - first) / _OUTWARD[ring]
        for k in range(_OUTWARD[ring]):
            # Circles are equally spaced in the cosine of emission, which crowds them toward the limb as the
            # Earth's surface is crowded there.
            inner, outer = first + k * step, first + (k + 1) * step
            solid_angle = (_nadir_cos(inner, ratio) - _nadir_cos(outer, ratio)) * 2.0 * math.pi / points
            emission_cos = 0.5 * (inner + outer)
            emission_sin = math.sqrt(1.0 - emission_cos * emission_cos)
            sine, cosine = ratio * emission_sin, _nadir_cos(emission_cos, ratio)
            view.circles[0, circle], view.circles[1, circle] = sine, cosine
            circle += 1
            # Angle at the Earth's centre between the sample and the point below the spacecraft.
            central_cos = emission_cos * cosine + emission_sin * sine
            central_sin = emission_sin * cosine - emission_cos * sine
            for a in range(azimuth, azimuth + points):
                cos_a, sin_a = central_sin * _COS_AZIMUTH[a], central_sin * _SIN_AZIMUTH[a]
                incidence = central_cos * sun_up + cos_a * sun_x
                view.light[sample] = 0.0
                if incidence > 0.0:
                    view.light[sample] = solar_flux / math.pi * incidence * solid_angle
                    view.cell[sample] = cell_at(
                        central_cos * up_e[0] + cos_a * x_e[0] + sin_a * y_e[0],
                        central_cos * up_e[1] + cos_a * x_e[1] + sin_a * y_e[1],
                        central_cos * up_e[2] + cos_a * x_e[2] + sin_a * y_e[2],
                        rows,
                        columns,
                    )
                sample += 1
        azimuth += points


@kernel
def gather_light(view: EarthView, reflectivity, light) -> None:
    """Second half of `albedo_sources`: samples, weighed with the reflectivities of one case, summed to patches."""
    values = reflectivity.reshape(-1)
    total = 0.0
    for i in range(3):
        light[DISC + i] = -view.frame[2, i]
    light[DISC + DISC_COS], light[DISC + DISC_SIN] = view.disc[0], view.disc[1]
    if view.disc[2] == 0.0:
        light[DISC + DISC_LIGHT] = 0.0
        return
    patch, first_sample, first_circle, first_azimuth = 0, 0, 0, 0
    for ring in range(len(_SECTORS)):
        around, outward = _AROUND[ring], _OUTWARD[ring]
        points = _SECTORS[ring] * around
        for sector in range(_SECTORS[ring]):
            sum_light, sum_x, sum_y, sum_z = 0.0, 0.0, 0.0, 0.0
            for k in range(outward):
                sine, cosine = view.circles[0, first_circle + k], view.circles[1, first_circle + k]
                for a in range(sector * around, (sector + 1) * around):
                    sample = first_sample + k * points + a
                    if view.light[sample] > 0.0:
                        w = view.light[sample] * values[view.cell[sample]]
                        sum_light += w
                        sum_x += w * sine * _COS_AZIMUTH[first_azimuth + a]
                        sum_y += w * sine * _SIN_AZIMUTH[first_azimuth + a]
                        sum_z -= w * cosine
            write_patch(sum_light, _in_n(view.frame, (sum_x, sum_y, sum_z)), patch, light)
            total += sum_light
            patch += 1
        first_sample += outward * points
        first_circle += outward
        first_azimuth += points
    light[DISC + DISC_LIGHT] = total


@kernel
def _in_n(frame, v: Vec3) -> Vec3:
    """A vector of the view's frame, in n."""
    return (
        v[0] * frame[0, 0] + v[1] * frame[1, 0] + v[2] * frame[2, 0],
        v[0] * frame[0, 1] + v[1] * frame[1, 1] + v[2] * frame[2, 1],
        v[0] * frame[0, 2] + v[1] * frame[1, 2] + v[2] * frame[2, 2],
    )


@kernel
def write_patch(total: float, moment_n: Vec3, patch: int, light) -> None:
    """Mean direction and size from the light of a patch and its first moment in n, into `light` (`new_light`)."""
    if total <= 0.0:
        for i in range(3):
            light[i * PATCHES + patch] = 0.0
        light[LIGHT + patch], light[SIZE + patch] = 0.0, 1.0
        return
    mean = scale(1.0 / total, moment_n)
    # The mean of unit vectors falls short of length one by the spread. A patch evenly bright over 2 size by 2 size
    # has a variance of size^2 / 3 along each of its two sides.
    size = max(_SMALLEST_SIZE, math.sqrt(max(0.0, 1.5 * (1.0 - dot(mean, mean)))))
    for i in range(3):
        light[i * PATCHES + patch] = mean[i]
    light[LIGHT + patch] = total / (4.0 * size)
    light[SIZE + patch] = size


@kernel
def upright_frame(r_n: Vec3, sun_n: Vec3) -> tuple[Vec3, Vec3, Vec3]:
    """Up, the horizontal direction toward the Sun, and the one across it."""
    up = unit(r_n)
    x = subtract(sun_n, scale(dot(sun_n, up), up))
    if norm(x) < 1e-6:  # the Sun overhead: any direction
        x = cross(up, (1.0, 0.0, 0.0) if abs(up[0]) < 0.7 else (0.0, 1.0, 0.0))
    x = unit(x)
    return up, x, cross(up, x)


@kernel
def _nadir_cos(emission_cos: float, ratio: float) -> float:
    """Cosine of the angle from nadir of a point of the disc whose light leaves at an angle from its vertical."""
    return math.sqrt(max(0.0, 1.0 - ratio * ratio * (1.0 - emission_cos * emission_cos)))


@kernel
def _emission_cos(fraction: float, disc_cos: float, ratio: float) -> float:
    """Cosine of emission on the circle about nadir that holds a fraction of the disc's solid angle."""
    cosine = 1.0 - fraction * (1.0 - disc_cos)
    return math.sqrt(max(0.0, 1.0 - (1.0 - cosine * cosine) / (ratio * ratio)))
