# SPDX-License-Identifier: Apache-2.0
"""The mission file of a design: every number with its unit and where it is from."""

import math
from collections.abc import Iterable, Iterator, Sequence

from css_design.new_mission.commented import Entry, parameter_file
from css_design.new_mission.design import Design
from css_design.new_mission.healthy_readings import healthy_readings

_NOTHING = 1e-6  # gains of a control that is asked for its model alone
_DARK = 0.12  # [-] output below which estimators take it for dark, unless the cells' noise asks for more
_LIT = 0.3
_NOISES = 5.0  # deviations of noise between a level and what must not reach it
_BIT_SPAN = 2.0  # converter from 0 to twice the full Sun
_FIELD_ERROR_NT = 300.0  # of the model of the field and what lasts of the magnetometer's errors
_SCALE_HEIGHTS = ((300e3, 50e3, 1.9e-11), (400e3, 58.5e3, 3.7e-12), (500e3, 63.8e3, 7.0e-13), (600e3, 71.8e3, 1.5e-13))
_HIGHEST_AIR = 1000e3


def mission_text(design: Design) -> str:
    """Text of the mission, as a parameter file."""
    sections = (
        ("/**", list(_shared(design))),
        ("dynamics", list(_dynamics(design))),
        ("css_array", list(_cells(design))),
        ("gyro", list(_gyro(design))),
        ("magnetometer", list(_magnetometer(design))),
        (design.estimator, list(_estimator(design))),
        (_control_name(design), list(_control(design))),
    )
    return parameter_file(_heading(design), sections)


def _heading(design: Design) -> str:
    kinds = [f"{len(design.normals)} Sun sensor cells"]
    if len(design.wheel_axes):
        kinds.append(f"{len(design.wheel_axes)} wheels")
    if design.asked["rods"] is not None:
        kinds.append("three torque rods")
    kinds.append("a gyro" if design.asked["gyro"] is not None else "no gyro")
    taken = sorted({origin for origin in design.origin.values() if origin not in ("given", "answered")})
    assumed = f" What nobody gave is that of the template {taken[0]} and marked [assumed]." if taken else ""
    return (
        f"{design.name}: {', '.join(kinds)}. {design.orbit.words}.\n\n"
        f"Written by ./sunpoint new. [computed] follows from the other numbers.{assumed} Change what is not so, and "
        "fly it; what cannot fly is refused with the reason."
    )


def _said(design: Design, item: str, text: str = "") -> str:
    """A word about a value that was asked for: its unit or meaning, and that nobody gave it."""
    assumed = design.origin[item] not in ("given", "answered")
    return " ".join(filter(None, (text, "[assumed]" if assumed else "")))


def _shared(design: Design) -> Iterator[Entry]:
    asked, orbit = design.asked, design.orbit
    has_wheels = bool(len(design.wheel_axes))
    yield Entry("mission.name", design.name)
    yield Entry("mission.description", f"Sun acquisition of {design.name}")
    yield Entry("mission.epoch", orbit.epoch, "UTC")
    duration = math.ceil(asked["orbits"] * orbit.period_s / asked["period"]) * asked["period"]
    words = f"s, {asked['orbits']:g} orbits of {orbit.period_s / 60.0:.1f} min"
    yield Entry("mission.duration", duration, words)
    yield Entry("mission.period", asked["period"], _said(design, "period", "s, control cycle"))
    yield Entry("mission.seed", 1)
    yield Entry("mission.case", 0, "attitude, rate, errors and noise are drawn for the case")
    units = {"altitude": "m, over the equatorial radius", "j2": "the node drifts"}
    for key, value in orbit.parameters.items():
        yield Entry(f"orbit.{key}", value, _said(design, "orbit", units.get(key, "")))
    how = "[computed] kg m^2, about the centre of mass" if asked["inertia"] is None else "kg m^2"
    yield Entry("spacecraft.inertia", [float(f"{v:.6g}") for v in design.inertia.ravel()], how)
    yield Entry("spacecraft.array_normal", list(design.array_normal), _said(design, "array_normal"))
    yield Entry("cells.normals", _flat(design.normals), _said(design, "cells", "outward, a row of x, y, z each"))
    yield Entry("cells.field_of_view_deg", asked["field_of_view"], _said(design, "field_of_view", "full cone"))
    yield Entry("cells.clip_normal", [0.0, 0.0, 0.0], "no plane of the body hides the sky")
    if has_wheels:
        speed = asked["wheel_speed"] * 2.0 * math.pi / 60.0
        yield Entry("wheels.axes", _flat(design.wheel_axes), _said(design, "wheels"))
        inertia = float(f"{asked['wheel_momentum'] / speed:.6g}")
        yield Entry("wheels.inertia", inertia, "kg m^2 [computed] from momentum and speed")
        yield Entry("wheels.max_torque", asked["wheel_torque"], _said(design, "wheel_torque", "N m"))
        yield Entry("wheels.max_speed_rpm", asked["wheel_speed"], _said(design, "wheel_speed"))
    else:
        yield Entry("wheels.fitted", False)
    if asked["rods"] is not None:
        yield Entry("rods.fitted", True)
        yield Entry("rods.axes", [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])
        yield Entry("rods.max_dipole", asked["rods"], _said(design, "rods", "A m^2"))
    if not has_wheels:
        divider = max(1, round(1.0 / asked["period"]))
        yield Entry("magnetometer.divider", divider, "one measurement a second; before each the rods rest")
    # a body with rods alone keeps some of its spin
    detumbled = 0.5 if has_wheels else 4.0
    yield Entry("measures.detumbled_rate_deg_s", detumbled, "below it the body counts as detumbled")
    yield Entry("measures.late_time", 300.0, "s, the last sunlight, whose heading error studies state")
    yield Entry("graph.nodes", _nodes(design))
    yield Entry("graph.estimator", design.estimator)
    yield Entry("criteria.power_positive_late.min", 0.9, "share of the last sunlight with the arrays on the Sun")


def _nodes(design: Design) -> list[str]:
    sensors = [name for name in ("gyro", "magnetometer") if design.asked[name] is not None]
    names = ["dynamics", "css_array", *sensors]
    control = f"sunpoint_control/{_control_name(design)}"
    return [*(f"css_sim/{name}" for name in names), f"css_estimation/{design.estimator}", control]


def _control_name(design: Design) -> str:
    return "mrp_control" if len(design.wheel_axes) else "magnetic_control"


def _dynamics(design: Design) -> Iterator[Entry]:
    yield Entry("initial.rate", "direction", "of the size below, in any direction")
    yield Entry("initial.rate_deg_s", design.asked["tip_off"], _said(design, "tip_off"))
    yield Entry("substeps", design.substeps, "[computed] integration steps of a cycle at that rate, at least")
    yield Entry("disturbances.gravity_gradient", True)
    yield Entry("disturbances.solar_pressure", True)
    air = _air(design.orbit.perigee_m)
    yield Entry("disturbances.aerodynamic", air is not None)
    if air is not None:
        altitude, height, density = air
        yield Entry("air.density", density, "kg/m^3, mean activity of the Sun")
        yield Entry("air.altitude", altitude, "m")
        yield Entry("air.scale_height", height, "m")
    plates = design.plates
    yield Entry("panels.areas", [float(f"{a:.6g}") for a in plates.areas], "m^2 [computed], faces of the box, panels")
    yield Entry("panels.normals", _flat(plates.normals))
    yield Entry("panels.centres", [float(f"{v:.6g}") for v in _flat(plates.centres)], "m, from the centre of mass")


def _air(altitude: float) -> tuple[float, float, float] | None:
    """Altitude [m], scale height [m] and density [kg/m^3] there, of the exponential atmosphere (Wertz, Table L-6)."""
    if altitude > _HIGHEST_AIR:
        return None
    return min(((h, scale, density) for h, scale, density in _SCALE_HEIGHTS), key=lambda row: abs(row[0] - altitude))


def _cells(design: Design) -> Iterator[Entry]:
    asked = design.asked
    yield Entry("noise", asked["cell_noise"], _said(design, "cell_noise", "of full Sun, 1 sigma"))
    yield Entry("bits", int(asked["cell_bits"]), _said(design, "cell_bits", "of the converter; 0: continuous"))
    yield Entry("output_high", _BIT_SPAN, "full scale of the converter, in Suns")
    yield Entry("scale_cell_error", asked["cell_scale"], _said(design, "cell_scale", "1 sigma"))
    yield Entry("misalignment_deg", asked["cell_tilt"], _said(design, "cell_tilt", "1 sigma about each of two axes"))
    yield Entry("warp", False, "cosine cells")
    yield Entry("degradation", 0.0)


def _gyro(design: Design) -> Iterator[Entry]:
    if design.asked["gyro"] is not None:
        yield Entry("noise_deg_s", design.asked["gyro"], _said(design, "gyro", "of a sample, 1 sigma"))
        yield Entry("bias_deg_h", design.asked["gyro_bias"], _said(design, "gyro_bias", "1 sigma"))


def _magnetometer(design: Design) -> Iterator[Entry]:
    if design.asked["magnetometer"] is not None:
        yield Entry("noise_nt", design.asked["magnetometer"], _said(design, "magnetometer", "1 sigma"))


def _estimator(design: Design) -> Iterator[Entry]:
    asked, name = design.asked, design.estimator
    noise = asked["cell_noise"]
    if name in ("ekf", "wls"):
        yield Entry(
            "cell_sigma", design.cell_sigma, "[computed] noise, bits, scale and tilt of a cell, and 0.1 of Earthlight"
        )
    if name == "sun_filter":
        yield Entry("noise", max(noise, 1e-6), "[computed] that of the cells")
        yield Entry("output_low", 0.0, "the converter ends there, and with it the noise of dark cells")
        yield Entry("gain_sigma", asked["cell_scale"], "[computed] what nobody has calibrated")
        yield Entry("tilt_sigma_deg", asked["cell_tilt"], "[computed] likewise")
        yield Entry("rate.start_deg_s", max(asked["tip_off"], 0.1), "[computed] tip-off")
        if asked["gyro"] is not None:
            yield Entry("gyro.noise_deg_s", min(asked["gyro"], 10.0), "[computed] that of the gyro")
            yield Entry("gyro.bias_deg_h", asked["gyro_bias"], "[computed] likewise")
        yield from _field_of_filter(design)
    if asked["gyro"] is None and name != "sun_filter":
        yield Entry("use_gyro", False)
    if asked["gyro"] is None and asked["magnetometer"] is not None and name not in ("sun_filter",):
        yield Entry("rate.use_field", bool(len(design.wheel_axes)), "the rate about the Sun line, from the field")
    yield from healthy_readings(design)
    floor = round(_NOISES * noise, 4)
    # below these a cell may be lit by its noise alone
    yield Entry("eclipse.dark_level", max(_DARK, floor), "[computed] brightest cell below which it is dark")
    yield Entry("eclipse.lit_level", max(_LIT, 2.0 * floor), "[computed] above which it is light")
    if name != "sun_filter":
        gate = {"ekf": 0.4, "wls": 0.45, "wavg": 0.45}[name]
        yield Entry("gate", min(0.9, max(gate, floor)), "[computed] share of the brightest, over Earthlight and noise")
    yield Entry("minimum_output", min(0.9, max(_LIT, floor)), "[computed] no Sun unless a cell is above it")


def _field_of_filter(design: Design) -> Iterator[Entry]:
    noise = design.asked["magnetometer"]
    if noise is None:
        return
    yield Entry("use_field", True)
    yield Entry("field.noise_nt", noise, "[computed] that of the magnetometer")
    yield Entry("field.error_nt", _FIELD_ERROR_NT, "nT, of the model of the field")
    if not len(design.wheel_axes):
        dipole, field = design.asked["rods"], 3e-5
        yield Entry("rate.torque", float(f"{dipole * field:.2g}"), "[computed] N m, what the rods give")
        yield Entry("rate.torque_time", 10.0, "s, in which the body turns under the field")


def _control(design: Design) -> Iterator[Entry]:
    if not len(design.wheel_axes):
        yield Entry("law", "spin", "B-dot, then a spin about the Sun line")
        yield Entry("rest_before_measurement", True)
        yield Entry("spin.rate_deg_s", 3.0)
        yield Entry("modes.detumble_rate_deg_s", 8.0)
        yield Entry("modes.detumble_exit_rate_deg_s", 5.0)
        return
    loop = design.loop
    k, p = (_NOTHING, _NOTHING) if loop is None else (loop.gains.k, loop.gains.p)
    words = ""
    if loop is not None:
        words = (
            f"[computed] {loop.bandwidth / (2.0 * math.pi):.3g} Hz about the axis of the largest moment, limited by "
            f"{loop.limit}; gain margin {loop.margin_db:.1f} dB; 2 % in {loop.settling_s:.0f} s"
        )
    yield Entry("gains.k", k, words)
    yield Entry("gains.p", p, "N m s [computed]")
    yield Entry("gains.ki", 0.0)
    yield Entry("deadband_deg", 0.0)
    yield Entry("eclipse_behaviour", "hold_attitude" if design.asked["gyro"] is not None else "rate_damp")
    if design.asked["rods"] is not None and design.asked["magnetometer"] is not None:
        yield Entry("dumping.enabled", True, "wheels by the rods")
        yield Entry("dumping.gain", 0.001, "1/s")


def _flat(rows: Iterable[Sequence[float]]) -> list[float]:
    return [float(value) + 0.0 for row in rows for value in row]
