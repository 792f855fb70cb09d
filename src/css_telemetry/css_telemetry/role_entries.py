# SPDX-License-Identifier: Apache-2.0
"""The entries `aiding` and `truth` of a description: which columns estimators hear, and which they are held against."""

from collections.abc import Mapping
from typing import Any

from css_environment.tle_checks import format_faults
from css_telemetry.description import (
    BODY_AXES,
    DIRECTIONS,
    FRAMES,
    Aiding,
    AttitudeForm,
    ColumnForm,
    PositionForm,
    Truth,
    VectorForm,
    WheelForm,
)
from css_telemetry.entries import Children, Entry
from css_telemetry.units import (
    ANGLES,
    FIELDS,
    LENGTHS,
    RATES,
    SPEEDS,
    TEMPERATURES,
    WHEEL_SPEEDS,
    plain_unit,
)

_AXES = tuple(sign + axis for axis in "xyz" for sign in "+-")


def aiding_of(entry: Entry) -> Aiding:
    """What estimators hear. Raises ValueError, naming key and expectation."""
    if entry.value in ("", None):
        return Aiding()
    keys = entry.children(Aiding._fields, "aiding")
    given: dict[str, Any] = {}
    if (rate := keys.get("rate")) is not None:
        given["rate"] = _vector(rate, RATES)
    if (field := keys.get("field")) is not None:
        given["field"] = _vector(field, FIELDS)
    if (position := keys.get("position")) is not None:
        given["position"] = _position(position)
    if (wheels := keys.get("wheels")) is not None:
        given["wheels"] = _wheels(wheels)
    if (temperatures := keys.get("temperatures")) is not None:
        given["temperatures"] = tuple(_temperature(item) for item in temperatures.items())
    given |= _light(entry, keys)
    return Aiding(**given)


def truth_of(entry: Entry) -> Truth:
    """What estimates are held against. Raises ValueError, naming key and expectation."""
    if entry.value in ("", None):
        return Truth()
    keys = entry.children(Truth._fields, "truth")
    given: dict[str, Any] = {}
    if (sun := keys.get("sun")) is not None:
        given["sun"] = _vector(sun, None)
    if (attitude := keys.get("attitude")) is not None:
        given["attitude"] = _attitude(attitude)
    if (sun_inertial := keys.get("sun_inertial")) is not None:
        given["sun_inertial"] = sun_inertial.unit_vector()
    if (rate := keys.get("rate")) is not None:
        given["rate"] = _vector(rate, RATES)
    if (position := keys.get("position")) is not None:
        given["position"] = _position(position)
    given |= _light(entry, keys)
    if "sun_inertial" in given and "attitude" not in given:
        raise ValueError(f"{entry.name}.sun_inertial: given without attitude, expected both: it is a direction in n")
    return Truth(**given)


def _light(entry: Entry, keys: Children) -> dict[str, Any]:
    """The column that tells sunlight or shadow, if there is one."""
    if "eclipse" in keys and "illumination" in keys:
        raise ValueError(f"{entry.name}: eclipse and illumination given, expected one of them")
    for name in ("eclipse", "illumination"):
        if (column := keys.get(name)) is not None:
            form = ColumnForm(column.children(("column",))["column"].word())
            return {"illumination": form, "eclipse": name == "eclipse"}
    return {}


def _factor(keys: Children, key: str, units: Mapping[str, float]) -> float:
    """Factor of the unit that a key names."""
    entry = keys[key]
    expected = f"one of {', '.join(units)}"
    if entry.value is None:
        raise entry.wrong(expected)
    unit = plain_unit(entry.word())
    if unit not in units:
        raise entry.wrong(expected)
    return units[unit]


def _vector(entry: Entry, units: Mapping[str, float] | None) -> VectorForm:
    known = ("columns", "axes") if units is None else ("columns", "unit", "axes")
    keys = entry.children(known)
    x, y, z = keys["columns"].words(3)
    axes = keys.get("axes")
    return VectorForm(
        (x, y, z), 1.0 if units is None else _factor(keys, "unit", units), BODY_AXES if axes is None else _axes(axes)
    )


def _axes(entry: Entry) -> tuple[str, str, str]:
    """The axis of the body along which each column measures: `[+y, -x, +z]`."""
    words = [word if word[0] in "+-" else f"+{word}" for word in entry.words(3)]
    if any(word not in _AXES for word in words) or len({word[1] for word in words}) != 3:
        raise entry.wrong("x, y and z in some order with their signs, such as [+y, -x, +z]")
    return words[0], words[1], words[2]


def _attitude(entry: Entry) -> AttitudeForm:
    keys = entry.children(("columns", "order", "direction"))
    order = keys["order"].word(("xyzw", "wxyz", "matrix"))
    columns = keys["columns"].words(9 if order == "matrix" else 4)
    return AttitudeForm(columns, order, keys["direction"].word(DIRECTIONS))


def _position(entry: Entry) -> PositionForm:
    if isinstance(entry.value, dict) and "tle" in entry.value:
        lines = entry.children(("tle",))["tle"].words(2)
        for index, fault in format_faults((lines[0], lines[1])):
            raise ValueError(f"{entry.name}.tle: line {index + 1}: {fault}")
        return PositionForm("tle", tle=(lines[0], lines[1]))
    keys = entry.children(("frame", "columns", "unit", "velocity", "velocity_unit", "angle_unit"))
    frame = keys["frame"].word(FRAMES)
    velocity = keys.get("velocity")
    if velocity is not None and frame == "geodetic":
        raise ValueError(f"{velocity.name}: given with frame geodetic, expected none: it has no axes")
    return PositionForm(
        frame,
        keys["columns"].words(3),
        _factor(keys, "unit", LENGTHS),
        () if velocity is None else velocity.words(3),
        1.0 if velocity is None else _factor(keys, "velocity_unit", SPEEDS),
        _factor(keys, "angle_unit", ANGLES) if "angle_unit" in keys else ANGLES["deg"],
    )


def _wheels(entry: Entry) -> WheelForm:
    keys = entry.children(("columns", "unit", "axes", "inertia"))
    columns = keys["columns"].words()
    axes = tuple(axis.unit_vector() for axis in keys["axes"].items(len(columns)))
    inertia = keys.get("inertia")
    return WheelForm(
        columns, _factor(keys, "unit", WHEEL_SPEEDS), axes, None if inertia is None else inertia.positive()
    )


def _temperature(entry: Entry) -> ColumnForm:
    keys = entry.children(("column", "unit"))
    return ColumnForm(keys["column"].word(), 1.0, _factor(keys, "unit", TEMPERATURES))
