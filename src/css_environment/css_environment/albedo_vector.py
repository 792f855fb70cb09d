# SPDX-License-Identifier: Apache-2.0
"""Light of the Earth as one vector: closed forms of the visible sunlit cap, and the crude vector from nadir.

Benton (Clark safe-hold) sums the Earth's light to a vector from the centre of the visible sunlit area, with a magnitude
by the size of that area, the Sun's incidence on it and the reflectivity there. Spencer's equations (NASA TN D-885) are
not public; these closed forms stand for them. Radius R, spacecraft at r from the centre with zenith z, Sun s:

    psi    angle from z to s                    rho    angular radius of the visible cap, cos rho = R / r
    alpha  = acos(-cot psi cot rho)             half the arc of the cap's edge that is dark
    gamma  = atan2(sin rho sin alpha, cos rho sin psi - sin rho cos alpha cos psi)
    A      = 2 (pi - acos(cos psi / sin rho)) - 2 alpha cos rho               visible sunlit area / R^2
    N      = (gamma sin psi - sin rho cos rho sin alpha, 0, alpha sin^2 rho + gamma cos psi)   integral of n dA / R^2

with z along the zenith and x toward the Sun. All is lit for psi <= 90 deg - rho, A = 2 pi (1 - cos rho) and
N = (0, 0, pi sin^2 rho); nothing for psi >= 90 deg + rho. The light comes from R N / |N|; its magnitude, relative to
the Sun, is reflectivity (R / r)^2 (s.N) / (pi sin^2 rho). Against the integral over patches (`earth_light`) that is
right to 0.004 while all of the cap is lit. Near the terminator it is too bright, 0.070 against 0.034 with the Sun on
the horizon at 475 km, and too far from nadir.

Both vectors go out as one patch of light, so that `albedo.albedo_output` serves all models.
"""

import math

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, add, dot, multiply, norm, scale, subtract, unit
from css_environment.constants import EARTH_RADIUS
from css_environment.earth_light import (
    DISC,
    DISC_COS,
    DISC_LIGHT,
    DISC_SIN,
    EarthView,
    albedo_sources,
    upright_frame,
    write_patch,
)
from css_environment.earth_light import PATCHES as COUNT
from css_environment.eclipse import cylindrical_illumination
from css_environment.reflectivity import reflectivity_at

PATCHES, VECTOR, NADIR = 0, 1, 2
"""Models of the Earth's light: the integral over patches, the vector from the sunlit area, the vector from nadir."""

MODELS = {"patches": PATCHES, "vector": VECTOR, "nadir": NADIR}


@kernel
def lit_cap(psi: float, rho: float) -> tuple[float, Vec3]:
    """Visible sunlit area / R^2, and the integral of the outward normal over it / R^2.

    Args:
        psi: angle from zenith to Sun [rad], 0 to pi.
        rho: angular radius of the visible cap at the Earth's centre [rad], above 0, below pi / 2.

    Returns:
        area, and the vector along x (horizontal, toward the Sun), y and z (zenith).
    """
    sin_rho, cos_rho = math.sin(rho), math.cos(rho)
    if psi <= 0.5 * math.pi - rho:
        return 2.0 * math.pi * (1.0 - cos_rho), (0.0, 0.0, math.pi * sin_rho * sin_rho)
    if psi >= 0.5 * math.pi + rho:
        return 0.0, (0.0, 0.0, 0.0)
    sin_psi, cos_psi = math.sin(psi), math.cos(psi)
    cos_alpha = min(max(-cos_psi * cos_rho / (sin_psi * sin_rho), -1.0), 1.0)
    alpha = math.acos(cos_alpha)
    sin_alpha = math.sin(alpha)
    gamma = math.atan2(sin_rho * sin_alpha, cos_rho * sin_psi - sin_rho * cos_alpha * cos_psi)
    edge = math.acos(min(max(cos_psi / sin_rho, -1.0), 1.0))
    area = 2.0 * (math.pi - edge) - 2.0 * alpha * cos_rho
    x = gamma * sin_psi - sin_rho * cos_rho * sin_alpha
    return max(0.0, area), (x, 0.0, alpha * sin_rho * sin_rho + gamma * cos_psi)


@kernel
def albedo_vector(r_n: Vec3, sun_n: Vec3, solar_flux: float, dcm_en: Mat3, reflectivity) -> Vec3:
    """Light of the Earth [-] as a vector in n from the spacecraft toward the centre of the visible sunlit area.

    Args:
        r_n: position from the centre of the Earth [m].
        sun_n: unit vector to the Sun.
        solar_flux: relative to 1 AU.
        dcm_en: rotation from n to the Earth-fixed frame.
        reflectivity: (rows, columns) grid; read at the centre of the area, between its rows by interpolation.
    """
    distance = max(norm(r_n), 1.0001 * EARTH_RADIUS)
    ratio = EARTH_RADIUS / distance
    up, x, _ = upright_frame(r_n, sun_n)
    sun_up, sun_x = dot(sun_n, up), dot(sun_n, x)
    rho = math.acos(ratio)
    _, moment = lit_cap(math.atan2(sun_x, sun_up), rho)
    incidence = sun_x * moment[0] + sun_up * moment[2]
    if not incidence > 0.0:
        return (0.0, 0.0, 0.0)
    centre = unit(add(scale(moment[0], x), scale(moment[2], up)))
    sin_rho2 = 1.0 - ratio * ratio
    here = reflectivity_at(reflectivity, multiply(dcm_en, centre))
    magnitude = solar_flux * here * ratio * ratio * incidence / (math.pi * sin_rho2)
    return scale(magnitude, unit(subtract(scale(ratio, centre), up)))


@kernel
def nadir_vector(r_n: Vec3, sun_n: Vec3, solar_flux: float, reflectivity) -> Vec3:
    """The crude first model of Benton: constant light from nadir wherever the spacecraft is in sunlight.

    Its magnitude, relative to the Sun, is the first value of `reflectivity`.
    """
    return scale(-solar_flux * reflectivity[0, 0] * cylindrical_illumination(r_n, sun_n), unit(r_n))


@kernel
def earth_light_sources(
    model: int, view: EarthView, r_n: Vec3, sun_n: Vec3, solar_flux: float, dcm_en: Mat3, reflectivity, light
) -> None:
    """Light of the Earth at one instant by any of the models; arguments as in `earth_light.albedo_sources`."""
    if model == PATCHES:
        albedo_sources(view, r_n, sun_n, solar_flux, dcm_en, reflectivity, light)
    else:
        point_source(model, r_n, sun_n, solar_flux, dcm_en, reflectivity, light)


@kernel
def point_source(model: int, r_n: Vec3, sun_n: Vec3, solar_flux: float, dcm_en: Mat3, reflectivity, light) -> None:
    """The same for the models that are one vector, which need no view."""
    if model == VECTOR:
        vector = albedo_vector(r_n, sun_n, solar_flux, dcm_en, reflectivity)
    else:
        vector = nadir_vector(r_n, sun_n, solar_flux, reflectivity)
    ratio = EARTH_RADIUS / max(norm(r_n), 1.0001 * EARTH_RADIUS)
    up = unit(r_n)
    for i in range(3):
        light[DISC + i] = -up[i]
    light[DISC + DISC_COS], light[DISC + DISC_SIN] = math.sqrt(1.0 - ratio * ratio), ratio
    total = norm(vector)
    light[DISC + DISC_LIGHT] = total
    write_patch(total, vector, 0, light)
    for patch in range(1, COUNT):
        write_patch(0.0, (0.0, 0.0, 0.0), patch, light)
