# SPDX-License-Identifier: Apache-2.0
"""Units that telemetry is written in, as factors to SI, by the names that people give them."""

import math
import re
from collections.abc import Iterable

_DEGREE, _TURN = math.pi / 180.0, 2.0 * math.pi

TIME_UNITS = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1, "min": 60 * 10**9, "h": 3600 * 10**9, "d": 86400 * 10**9}
"""Nanoseconds in the units that times can have."""

_FIRST_NS, _LAST_NS = 946_684_800 * 10**9, 2_145_916_800 * 10**9  # 2000 to 2038


def unit_of_our_days(value: float, units: Iterable[str] = ("s", "ms", "us", "ns")) -> str | None:
    """The unit in which a count since 1970 is a time of our days; None: in none. The spans do not overlap."""
    return next((unit for unit in units if _FIRST_NS <= value * TIME_UNITS[unit] < _LAST_NS), None)


RATES = {"rad/s": 1.0, "mrad/s": 1e-3, "deg/s": _DEGREE, "mdeg/s": 1e-3 * _DEGREE, "rpm": _TURN / 60.0}
FIELDS = {"T": 1.0, "mT": 1e-3, "uT": 1e-6, "nT": 1e-9, "G": 1e-4, "mG": 1e-7}
LENGTHS = {"m": 1.0, "km": 1e3}
SPEEDS = {"m/s": 1.0, "km/s": 1e3}
WHEEL_SPEEDS = {"rad/s": 1.0, "rpm": _TURN / 60.0, "deg/s": _DEGREE, "Hz": _TURN}
ANGLES = {"rad": 1.0, "deg": _DEGREE}
OUTPUTS = ("V", "mV", "uV", "A", "mA", "uA", "counts", "1")
TEMPERATURES = {"degC": 0.0, "K": -273.15}
"""What is to be added for degrees Celsius."""

_WORDS = {
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "msec": "ms", "millisecond": "ms", "milliseconds": "ms",
    "µs": "us", "μs": "us", "usec": "us", "microseconds": "us", "nanoseconds": "ns", "nsec": "ns", "minutes": "min",
    "hours": "h", "days": "d", "day": "d",
    "dps": "deg/s", "°/s": "deg/s", "deg_s": "deg/s", "deg_per_s": "deg/s", "deg/sec": "deg/s", "degps": "deg/s",
    "mdps": "mdeg/s", "rad_s": "rad/s", "rad_per_s": "rad/s", "rad/sec": "rad/s", "rps": "Hz", "rev/s": "Hz",
    "rev/min": "rpm", "1/min": "rpm", "1/s": "Hz",
    "tesla": "T", "gauss": "G", "milligauss": "mG", "mgauss": "mG", "nanotesla": "nT", "microtesla": "uT",
    "µt": "uT", "μt": "uT", "µT": "uT", "μT": "uT",
    "kilometers": "km", "meters": "m", "metres": "m", "degrees": "deg", "°": "deg", "radians": "rad",
    "volt": "V", "volts": "V", "ampere": "A", "amperes": "A", "amps": "A", "µa": "uA", "µA": "uA", "μA": "uA",
    "count": "counts", "cts": "counts", "lsb": "counts", "adu": "counts", "raw": "counts", "dn": "counts",
    "°c": "degC", "c": "degC", "celsius": "degC", "deg_c": "degC", "kelvin": "K", "-": "1", "none": "1", "norm": "1",
}  # fmt: skip
_EXACT = {
    unit: unit
    for units in (TIME_UNITS, RATES, FIELDS, LENGTHS, SPEEDS, WHEEL_SPEEDS, ANGLES, OUTPUTS, TEMPERATURES)
    for unit in units
}
_LOWER = {unit.lower(): unit for unit in ("rad/s", "deg/s", "nT", "uT", "km", "km/s", "counts", "degC", "rpm", "utc")}


def plain_unit(text: str) -> str:
    """The usual name of a unit, the text itself when it is none that is known."""
    text = re.sub(r"\s+", "", text).replace("^-1", "").replace("·", "")
    return _EXACT.get(text) or _WORDS.get(text) or _WORDS.get(text.lower()) or _LOWER.get(text.lower()) or text


def is_unit(text: str) -> bool:
    """Whether a text is the name of a unit."""
    return plain_unit(text) in _EXACT or text.lower() in ("utc", "iso", "iso 8601", "unix", "deg", "quat")
