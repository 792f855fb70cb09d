# SPDX-License-Identifier: Apache-2.0
"""Guesses which column of a table is the time, in which unit and scale it counts, and why."""

import re
from typing import NamedTuple

import numpy as np

from css_telemetry.description import TimeForm
from css_telemetry.header import plain_name
from css_telemetry.instants import instant_ns
from css_telemetry.table_text import Table, name_and_unit
from css_telemetry.units import TIME_UNITS, plain_unit, unit_of_our_days
from css_telemetry.values import is_number

_TIME = re.compile(
    r"(?:.*_)?(?:time|timestamp|utc|datetime|epoch|t|unix|unixtime|gpst|gps_time|tai|met|obt|sclk|stamp|instant|clock)"
    r"(?:_(?:s|ms|us|ns|sec|utc|gps|tai|unix|iso))?"
)
_DATE = re.compile(r"(?:.*_)?(?:date|day|doy)")
_WEEK = re.compile(r"(?:gps_?)?(?:week|wn)(?:_?n(?:o|umber)?)?")
_OF_WEEK = re.compile(r"(?:gps_?)?(?:tow|sow|seconds?_of_week|time_of_week)(?:_s)?")
_GPS_FIRST_S, _GPS_LAST_S = 6.3e8, 1.9e9  # 2000 to 2038 since 1980


class TimeGuess(NamedTuple):
    """What the times are taken for."""

    form: TimeForm
    why: str
    sure: bool


def guessed_time(table: Table, texts: dict[str, list[str]], decimal_comma: bool) -> TimeGuess | None:
    """The time of a table; None: no column looks like one.

    Args:
        table: its header is read.
        texts: first fields of each column.
        decimal_comma: numbers have a comma in the place of the point.
    """
    plain = {name: plain_name(name_and_unit(name)[0]) for name in table.header if name}
    week = next((name for name, p in plain.items() if _WEEK.fullmatch(p)), None)
    of_week = next((name for name, p in plain.items() if _OF_WEEK.fullmatch(p)), None)
    if week and of_week:
        return TimeGuess(TimeForm((week, of_week), "s", "gps"), "week and seconds of GPS, by their names", True)
    times = [name for name, p in plain.items() if _TIME.fullmatch(p)]
    dates = [name for name, p in plain.items() if _DATE.fullmatch(p)]
    for date in dates:
        for time in times:
            if _is_instant(f"{_first(texts[date])}T{_first(texts[time])}") and not _is_instant(_first(texts[time])):
                return TimeGuess(TimeForm((date, time)), "a date and a time of the day", True)
    candidates = [*times, *dates, *(name for name in table.header[:1] if name)]
    for name in candidates:
        guess = _of_column(table, name, _first(texts[name]), plain[name], decimal_comma)
        if guess is not None and (name in times or name in dates or _grows(texts[name], decimal_comma)):
            return guess
    return None


def _first(fields: list[str]) -> str:
    return next((field for field in fields if field), "")


def _is_instant(text: str) -> bool:
    try:
        instant_ns(text)
    except (ValueError, OverflowError):
        return False
    return not is_number(text)


def _grows(fields: list[str], decimal_comma: bool) -> bool:
    texts = [field.replace(",", ".") for field in fields] if decimal_comma else fields
    if not all(map(is_number, texts)):
        return all(map(_is_instant, texts))
    return bool(np.all(np.diff([float(text) for text in texts]) > 0.0))


def _of_column(table: Table, name: str, text: str, plain: str, decimal_comma: bool) -> TimeGuess | None:
    number = text.replace(",", ".") if decimal_comma else text
    if not is_number(number):
        scale = _scale(plain, "utc")
        return TimeGuess(TimeForm((name,), "s", scale), "instants in ISO 8601", True) if _is_instant(text) else None
    told = plain_unit(table.units[table.header.index(name)])
    units = [told] if told in TIME_UNITS else ["s", "ms", "us", "ns"]
    value = float(number)
    if _scale(plain, "") in ("gps", "tai"):
        scale = _scale(plain, "")
        for unit in units:
            if scale == "tai" or _GPS_FIRST_S < value * TIME_UNITS[unit] * 1e-9 < _GPS_LAST_S:
                return TimeGuess(TimeForm((name,), unit, scale), f"{scale.upper()} by its name", True)
    found = unit_of_our_days(value, units)
    if found is not None:
        why = f"{text} {found} since 1970 is a time of our days"
        return TimeGuess(TimeForm((name,), found, "unix"), why, told in TIME_UNITS or found != "s" or value > 9.4e8)
    unit = told if told in TIME_UNITS else "s"
    why = f"{text} {unit} is no time of our days: since a boot whose instant the table does not tell"
    return TimeGuess(TimeForm((name,), unit, "boot"), why, False)


def _scale(plain: str, otherwise: str) -> str:
    words = set(plain.split("_"))
    return "gps" if words & {"gps", "gpst", "gpstime"} else "tai" if "tai" in words else otherwise
