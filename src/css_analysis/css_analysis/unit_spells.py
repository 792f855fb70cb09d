# SPDX-License-Identifier: Apache-2.0
"""Which units failed in a flight and which were held for failed, and when."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from css_analysis.flight_log import FlightLog
from css_common.message_columns import Columns
from css_msgs.msg import SunEstimate

_SORTS = ("cell", "wheel", "rod", "gyro", "magnetometer", "tachometer")
_SENSORS = {
    "gyro": SunEstimate.LEFT_GYRO | SunEstimate.HELD_GYRO,
    "magnetometer": SunEstimate.LEFT_FIELD | SunEstimate.HELD_FIELD,
}
CONTROL = "control"
"""Who leaves out actuators, in the absence of a name."""


class Spell(NamedTuple):
    """A time in which a unit failed, or in which somebody held it for failed."""

    target: str  # such as `cell.3`, or `gyro` as a whole
    by: str  # who held it for failed; empty: it failed
    begin_s: float
    end_s: float | None  # None: to the end of the flight


def spells(log: FlightLog) -> list[Spell]:
    """Of all units of a flight."""
    failed = [Spell(f.target, "", f.begin_s, f.end_s) for f in log.faults]
    return failed + held_spells(log)


def held_spells(log: FlightLog) -> list[Spell]:
    """The times in which estimators and control held units for failed, by what they published."""
    return [
        Spell(target, name, begin_s, until_s)
        for name, target, columns, on in _masks(log)
        for begin_s, until_s in _runs(log.time(columns), on)
    ]


def _masks(log: FlightLog) -> Iterator[tuple[str, str, Columns, np.ndarray]]:
    """Who holds which unit for failed, and at which messages."""
    for name, columns in (*log.estimates.items(), *log.attitudes.items()):
        yield from _bits(name, "cell", columns, columns.isolated)
    for name, columns in log.estimates.items():
        for target, bits in _SENSORS.items():
            on = (columns.sensors_left & bits) != 0
            if on.any():
                yield name, target, columns, on
    if log.control is not None:
        yield from _bits(CONTROL, "wheel", log.control, log.control.wheels_isolated)
        yield from _bits(CONTROL, "rod", log.control, log.control.rods_isolated)


def _bits(name: str, sort: str, columns: Columns, masks: np.ndarray) -> Iterator[tuple[str, str, Columns, np.ndarray]]:
    ever = int(np.bitwise_or.reduce(masks))
    for i in range(32):
        if ever >> i & 1:
            yield name, f"{sort}.{i}", columns, (masks >> np.uint32(i) & 1) != 0


def _runs(time_s: np.ndarray, on: np.ndarray) -> Iterator[tuple[float, float | None]]:
    """Begin and end [s] of each stretch of messages with a unit held for failed."""
    turns = np.flatnonzero(np.diff(np.concatenate(([0], on.astype(int), [0]))))
    for first, after in zip(turns[::2], turns[1::2], strict=True):
        yield float(time_s[first]), float(time_s[after]) if after < len(time_s) else None


def has_spells(log: FlightLog) -> bool:
    """Whether anything failed or was held for failed."""
    return bool(log.faults) or next(_masks(log), None) is not None


def rank(target: str) -> tuple[int, int, str]:
    """Key that sorts units: cells first, then wheels, rods and the other sensors, each by number."""
    sort, _, unit = target.partition(".")
    return _SORTS.index(sort) if sort in _SORTS else len(_SORTS), int(unit) if unit.isdecimal() else -1, unit
