# SPDX-License-Identifier: Apache-2.0
"""Guesses at what the columns of a table are, by their names, units and first values, each with its reason."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from css_telemetry.header import plain_name
from css_telemetry.table_text import Table, name_and_unit
from css_telemetry.units import FIELDS, LENGTHS, RATES, SPEEDS, TEMPERATURES, WHEEL_SPEEDS, plain_unit

_FRAME = r"(?:_(?:b|body|bus|sc))?"
_RATE_WORDS = r"(?:omega|omg|gyro?|gyroscope|rate|ang_?vel|angular_velocity|body_rate|imu_gyro|w)"
_FIELD_WORDS = r"(?:mag|magnetometer|magnetic_field|field|bfield|b|mtm)"
_KINDS = {
    "rate": re.compile(rf"{_RATE_WORDS}s?_?([xyz123]){_FRAME}(?:_.*)?"),
    "field": re.compile(rf"{_FIELD_WORDS}_?([xyz123]){_FRAME}(?:_(?:n|u|m)?(?:t|g|tesla|gauss))?"),
    "sun": re.compile(rf"(?:true_)?(?:sun|sun_vector|sunvec|sv|s){_FRAME}_?([xyz]){_FRAME}"),
    "velocity": re.compile(r"(?:v|vel|velocity)_?(?:eci|ecef|j2000|itrf|gps|teme)?_?([xyz])(?:_.*)?"),
    "position": re.compile(
        r"(?:r|pos|position|eci|ecef|gps|gps_pos|j2000|itrf|teme)_?(?:eci|ecef|teme)?_?([xyz])(?:_.*)?"
    ),
}
_QUATERNION = re.compile(r"(?:q|quat|quaternion|att|q_bn|q_bi|q_ib)_?([wxyzs0-4])")
_GEODETIC = (
    re.compile(r"(?:gps_)?lat(?:itude)?(?:_deg|_rad)?"),
    re.compile(r"(?:gps_)?lon(?:g|gitude)?(?:_deg|_rad)?"),
    re.compile(r"(?:gps_)?(?:alt|altitude|height|h)(?:_k?m)?"),
)
_WHEEL = re.compile(r"(?:rw|wheel|reaction_wheel|rwa)_?(?:speed_?)?([0-9xyz])(?:_?(?:speed|rpm|rate|omega))?(?:_.*)?")
_TEMPERATURE = re.compile(r"(?:t|temp|temperature)(?:_.*)?|.*_(?:temp|temperature)(?:_.*)?")
_ECLIPSE = re.compile(r"(?:in_)?(?:eclipse|umbra|shadow|eclipsed)(?:_flag)?")
_ILLUMINATION = re.compile(r"(?:illumination|sunlit|in_sun|sun_fraction|lit)(?:_flag)?")
_FACE = re.compile(
    r"(?:.*?[ _])??(?:(?P<sign>[pmn+-]|plus_?|minus_?|pos_?|neg_?)(?P<axis>[xyz])"
    r"|(?P<axis2>[xyz])_?(?P<sign2>[pmn+-]|plus|minus|pos|neg))(?:[ _]\w*)?"
)
_CELL = re.compile(
    r"(?:.*_)?(?:css|cell|pd|photodiode|diode|coarse_sun_sensor|sun_?sensor|ss|sol|i_pd|adc|ch|face)_?\w*"
)
_MINUS = {"m", "n", "-", "minus", "minus_", "neg", "neg_"}


@dataclass
class Guess:
    """Columns of one kind.

    Attributes:
        columns: in their order.
        unit: of their values, empty when it is not told.
        why: the reason, for a comment.
    """

    columns: tuple[str, ...]
    unit: str = ""
    why: str = ""


@dataclass
class Guesses:
    """What the columns of a table are taken for.

    Attributes:
        vectors: by kind: rate, field, sun, position, velocity, geodetic.
        attitude: columns and order of a quaternion.
        wheels, temperatures: columns.
        light: column of the eclipse flag or the illumination, and which of them it is.
        cells: columns and normals, None where the name does not tell one.
    """

    vectors: dict[str, Guess] = field(default_factory=dict)
    attitude: tuple[Guess, str] | None = None
    wheels: Guess | None = None
    temperatures: list[Guess] = field(default_factory=list)
    light: tuple[str, str] | None = None
    cells: dict[str, tuple[float, float, float] | None] = field(default_factory=dict)


def guessed(table: Table, first: dict[str, np.ndarray], times: Sequence[str]) -> Guesses:
    """Guesses of a table.

    Args:
        table: its header is read.
        first: (K,) numbers of the first lines of each column that has numbers.
        times: columns of the time.
    """
    free = [name for name in table.header if name and name not in times]
    plain = {name: plain_name(name_and_unit(name)[0]) for name in free}
    guesses = Guesses()
    # faces first: `px` and `sun_sensor_x+` look like other things too
    for name in list(free):
        normal = face_normal(name_and_unit(name)[0])
        if normal is not None:
            guesses.cells[name] = normal
            free.remove(name)
    _vectors(table, guesses, free, plain, first)
    _attitude(table, guesses, free, plain)
    _rest(table, guesses, free, plain, first)
    return guesses


def face_normal(name: str) -> tuple[float, float, float] | None:
    """The normal that a cell's name tells: `css_px`, `+X`, `PD Z-`, `face_minus_y`."""
    text = re.sub(r"[^a-z0-9+-]+", "_", name.lower()).strip("_")
    found = _FACE.fullmatch(text)
    if found is None or text in ("mag", "gyro"):
        return None
    sign, axis = found["sign"] or found["sign2"], found["axis"] or found["axis2"]
    value = -1.0 if sign in _MINUS else 1.0
    x, y, z = (value if axis == letter else 0.0 for letter in "xyz")
    return x, y, z


def _vectors(
    table: Table, guesses: Guesses, free: list[str], plain: dict[str, str], first: dict[str, np.ndarray]
) -> None:
    for kind, pattern in _KINDS.items():
        by_axis: dict[str, str] = {}
        for name in free:
            found = pattern.fullmatch(plain[name])
            if found:
                by_axis.setdefault({"1": "x", "2": "y", "3": "z"}.get(found[1], found[1]), name)
        if len(by_axis) == 3:
            columns = tuple(by_axis[axis] for axis in "xyz")
            guesses.vectors[kind] = Guess(columns, *_unit(kind, table, columns, first))
            for name in columns:
                free.remove(name)
    places = [next((name for name in free if p.fullmatch(plain[name])), None) for p in _GEODETIC]
    if all(places) and "position" not in guesses.vectors:
        columns = tuple(name for name in places if name is not None)
        largest = _largest(columns[2:], first)
        unit = _told(table, columns[2], LENGTHS) or ("km" if largest < 5e4 else "m")
        guesses.vectors["geodetic"] = Guess(columns, unit, f"heights up to {largest:g}")
        for name in columns:
            free.remove(name)


def _told(table: Table, column: str, units: dict[str, float]) -> str:
    """The unit that the header tells of a column, by brackets, the row of units or the end of its name."""
    told = plain_unit(table.units[table.header.index(column)])
    if told in units:
        return told
    name = plain_name(name_and_unit(column)[0])
    endings = {
        "deg_s": "deg/s", "dps": "deg/s", "rad_s": "rad/s", "deg_per_s": "deg/s", "rad_per_s": "rad/s", "rpm": "rpm",
        "nt": "nT", "ut": "uT", "mt": "mT", "t": "T", "gauss": "G", "mgauss": "mG", "km": "km", "m": "m",
        "km_s": "km/s", "m_s": "m/s", "kmps": "km/s", "mps": "m/s", "degc": "degC", "c": "degC", "k": "K",
    }  # fmt: skip
    for ending, unit in endings.items():
        if name.endswith(f"_{ending}") and unit in units:
            return unit
    return ""


def _unit(kind: str, table: Table, columns: tuple[str, ...], first: dict[str, np.ndarray]) -> tuple[str, str]:
    """Unit of a vector and the reason for it."""
    if kind == "sun":
        return "", "by their names; a direction of any length in the body frame"
    units = {"rate": RATES, "field": FIELDS, "position": LENGTHS, "velocity": SPEEDS}[kind]
    told = _told(table, columns[0], units)
    if told:
        return told, f"the header says {told}"
    largest = _largest(columns, first)
    if kind == "rate":
        unit = "deg/s" if largest > 0.5 else "rad/s"
    elif kind == "field":
        # the Earth's field is 20 to 65 uT in low orbits
        unit = (
            "T"
            if largest < 1e-3
            else "G"
            if largest < 1.0
            else "uT"
            if largest < 150.0
            else "mG"
            if largest < 1e3
            else "nT"
        )
    elif kind == "position":
        unit = "km" if largest < 1e6 else "m"
    else:
        unit = "km/s" if largest < 50.0 else "m/s"
    return unit, f"no unit told; the largest of the first values is {largest:.3g}"


def _largest(columns: Sequence[str], first: dict[str, np.ndarray]) -> float:
    values = np.concatenate([first[name] for name in columns if name in first] or [np.zeros(0)])
    values = values[np.isfinite(values)]
    return float(np.max(np.abs(values))) if len(values) else 0.0


def _attitude(table: Table, guesses: Guesses, free: list[str], plain: dict[str, str]) -> None:
    found = {m[1]: name for name in free if (m := _QUATERNION.fullmatch(plain[name]))}
    for letters, order, why in (
        ("xyzw", "xyzw", "by their names"),
        ("xyzs", "xyzw", "by their names, s the scalar"),
        ("1234", "xyzw", "q4 taken for the scalar"),
        ("0123", "wxyz", "q0 taken for the scalar"),
    ):
        if all(letter in found for letter in letters):
            columns = tuple(found[letter] for letter in letters)
            guesses.attitude = Guess(columns, "", why), order
            for name in columns:
                free.remove(name)
            return


def _rest(table: Table, guesses: Guesses, free: list[str], plain: dict[str, str], first: dict[str, np.ndarray]) -> None:
    wheels = [name for name in free if _WHEEL.fullmatch(plain[name]) and name in first]
    if wheels:
        told = _told(table, wheels[0], WHEEL_SPEEDS)
        guesses.wheels = Guess(tuple(wheels), told or "rpm", "the header says it" if told else "no unit told")
    for name in free:
        if name in wheels or name not in first:
            continue
        if _ECLIPSE.fullmatch(plain[name]):
            guesses.light = guesses.light or (name, "eclipse")
        elif _ILLUMINATION.fullmatch(plain[name]):
            guesses.light = guesses.light or (name, "illumination")
        elif _TEMPERATURE.fullmatch(plain[name]):
            told = _told(table, name, TEMPERATURES)
            kelvin = _largest([name], first) > 150.0
            unit = told or ("K" if kelvin else "degC")
            guesses.temperatures.append(Guess((name,), unit, "the header says it" if told else "by its values"))
        elif _CELL.fullmatch(plain[name]):
            guesses.cells[name] = None
