# SPDX-License-Identifier: Apache-2.0
"""Environmental torques on the spacecraft: gravity gradient, aerodynamic drag, solar pressure, residual dipole.

Formulas as in Wertz (ed.), Spacecraft Attitude Determination and Control, section 17.2. Drag and solar pressure act
on flat panels that do not shade each other. Everything is off unless asked for: O'Keefe & Schaub 2013 has none.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from css_common.declared import builder, given, made, table_of
from css_common.kernel import kernel, outer_kernel
from css_common.schema import Values, flag, real, reals
from css_common.vectors import Mat3, Vec3, add, cross, dot, multiply, norm, scale, unit, vector_of
from css_environment.atmosphere import ATMOSPHERE_400_KM, ExponentialAtmosphere, air_velocity, density
from css_environment.ephemeris import EnvironmentState
from css_environment.gravity_gradient import gravity_gradient_torque

GRAVITY_GRADIENT = flag("disturbances.gravity_gradient", False, "torque of the Earth's gravity gradient")
AERODYNAMIC = flag("disturbances.aerodynamic", False, "torque of drag on the panels")
SOLAR_PRESSURE_ACTS = flag("disturbances.solar_pressure", False, "torque of sunlight on the panels")
TORQUE = reals("disturbances.torque", (0.0, 0.0, 0.0), "N m", "constant torque in b, of a leak for instance", length=3)
DIPOLE = reals("disturbances.dipole", (0.0, 0.0, 0.0), "A m^2", "residual magnetic dipole of the spacecraft", length=3)
_AREAS = reals("panels.areas", (), "m^2", "area of each flat panel; a plate with two sides is two panels", low=0.0)
_NORMALS = reals("panels.normals", (), "-", "outward unit normals of the panels in b, a row each", columns=3)
_CENTRES = reals("panels.centres", (), "m", "centres of the panels in b from the centre of mass, a row each", columns=3)
_SPECULAR = real("panels.specular", 0.1, "-", "fraction of sunlight reflected like a mirror", low=0.0, high=1.0)
_DIFFUSE = real("panels.diffuse", 0.2, "-", "fraction of sunlight scattered", low=0.0, high=1.0)

SOLAR_PRESSURE = 4.56e-6
"""Pressure of sunlight on a black surface at 1 AU [N/m^2] (Montenbruck & Gill, section 3.4)."""

PANEL = np.dtype([(name, np.float64) for name in ("area", "nx", "ny", "nz", "cx", "cy", "cz")], align=True)
"""One panel: area [m^2], outward unit normal and centre [m] from the centre of mass, both in b."""


def _panels(areas: np.ndarray, normals_b: np.ndarray, centres_b: np.ndarray) -> np.ndarray:
    panels = np.zeros(len(areas), PANEL)
    panels["area"] = areas
    panels["nx"], panels["ny"], panels["nz"] = normals_b.T
    panels["cx"], panels["cy"], panels["cz"] = centres_b.T
    return panels


class Disturbances(NamedTuple):
    """Which torques act, and on what."""

    gravity_gradient: bool = given(GRAVITY_GRADIENT)
    aerodynamic: bool = given(AERODYNAMIC)
    solar_pressure: bool = given(SOLAR_PRESSURE_ACTS)
    torque_b: Vec3 = made(vector_of, TORQUE)  # [N m]
    dipole_b: Vec3 = made(vector_of, DIPOLE)  # [A m^2]
    atmosphere: ExponentialAtmosphere = made(
        ExponentialAtmosphere,
        real(
            "air.density", ATMOSPHERE_400_KM.reference_density, "kg/m^3", "density at air.altitude", low=0.0, high=1.0
        ),
        real("air.altitude", ATMOSPHERE_400_KM.reference_altitude, "m", "where air.density holds", low=0.0, high=1e7),
        real(
            "air.scale_height",
            ATMOSPHERE_400_KM.scale_height,
            "m",
            "climb over which the density falls by 1/e",
            low=100.0,
            high=1e7,
        ),
    )
    panels: np.ndarray = made(_panels, _AREAS, _NORMALS, _CENTRES)  # (K,) of PANEL
    drag_coefficient: float = given(
        real("panels.drag_coefficient", 2.2, "-", "drag coefficient of all panels", low=0.0, high=10.0)
    )
    specular: float = given(_SPECULAR)
    diffuse: float = given(_DIFFUSE)


PARAMETERS = table_of(Disturbances)
parameters = builder(Disturbances)


def conflicts(values: Values) -> Iterator[str]:
    """What is wrong between the values, one message each."""
    count = len(values[_AREAS])
    for rows in (_NORMALS, _CENTRES):
        if len(values[rows]) != count:
            yield f"{rows.name}: {len(values[rows])} rows given for {count} areas, expected one each"
    for i, length in enumerate(np.linalg.norm(values[_NORMALS], axis=1)):
        if abs(length - 1.0) > 1e-6:
            yield f"panels.normals: row {i} has length {length:.6g}, expected unit vectors"
    if values[_SPECULAR] + values[_DIFFUSE] > 1.0:
        total = values[_SPECULAR] + values[_DIFFUSE]
        yield f"panels.specular + panels.diffuse: {total:.6g} given, expected at most 1"
    for acts in (AERODYNAMIC, SOLAR_PRESSURE_ACTS):
        if values[acts] and count == 0:
            yield f"{acts.name}: true given without panels, expected panels.areas, normals and centres"


@outer_kernel
def with_dipole(p: Disturbances, dipole_b: Vec3) -> Disturbances:
    """The same disturbances with another residual dipole [A m^2]."""
    return Disturbances(
        p.gravity_gradient,
        p.aerodynamic,
        p.solar_pressure,
        p.torque_b,
        dipole_b,
        p.atmosphere,
        p.panels,
        p.drag_coefficient,
        p.specular,
        p.diffuse,
    )


@kernel
def aerodynamic_torque(panels, drag_coefficient: float, velocity_b: Vec3, air_density: float) -> Vec3:
    """Torque [N m] of air of a given density [kg/m^3] met at `velocity_b` [m/s]; momentum flux opposes the velocity."""
    speed = norm(velocity_b)
    wind = unit(velocity_b)
    pressure = 0.5 * air_density * drag_coefficient * speed * speed
    moment = (0.0, 0.0, 0.0)
    for i in range(panels.shape[0]):
        panel = panels[i]
        facing = dot((panel.nx, panel.ny, panel.nz), wind)
        if facing > 0.0:
            moment = add(moment, scale(panel.area * facing, (panel.cx, panel.cy, panel.cz)))
    return scale(-pressure, cross(moment, wind))


@kernel
def solar_pressure_torque(panels, specular: float, diffuse: float, sun_b: Vec3, pressure: float) -> Vec3:
    """Torque [N m] of sunlight from the unit direction `sun_b` with a `pressure` [N/m^2] on black surfaces."""
    torque = (0.0, 0.0, 0.0)
    for i in range(panels.shape[0]):
        panel = panels[i]
        n = (panel.nx, panel.ny, panel.nz)
        facing = dot(n, sun_b)
        if facing > 0.0:
            along_sun = scale(1.0 - specular, sun_b)
            along_normal = scale(2.0 * (specular * facing + diffuse / 3.0), n)
            force = scale(-pressure * panel.area * facing, add(along_sun, along_normal))
            torque = add(torque, cross((panel.cx, panel.cy, panel.cz), force))
    return torque


@kernel
def disturbance_torque(p: Disturbances, inertia: Mat3, dcm_bn: Mat3, environment: EnvironmentState) -> Vec3:
    """Sum of the torques that `p` asks for [N m], in b.

    Args:
        inertia: of the whole spacecraft [kg m^2].
        dcm_bn: attitude.
        environment: what surrounds the spacecraft.
    """
    torque = p.torque_b
    if p.gravity_gradient:
        torque = add(torque, gravity_gradient_torque(inertia, multiply(dcm_bn, environment.r_n)))
    if p.aerodynamic:
        air_density = density(p.atmosphere, environment.r_n)
        velocity_b = multiply(dcm_bn, air_velocity(environment.r_n, environment.v_n))
        torque = add(torque, aerodynamic_torque(p.panels, p.drag_coefficient, velocity_b, air_density))
    if p.solar_pressure and environment.illumination > 0.0:
        pressure = SOLAR_PRESSURE * environment.solar_flux * environment.illumination
        sun_b = multiply(dcm_bn, environment.sun_n)
        torque = add(torque, solar_pressure_torque(p.panels, p.specular, p.diffuse, sun_b, pressure))
    m = p.dipole_b
    if m[0] != 0.0 or m[1] != 0.0 or m[2] != 0.0:
        torque = add(torque, cross(m, multiply(dcm_bn, environment.field_n)))
    return torque
