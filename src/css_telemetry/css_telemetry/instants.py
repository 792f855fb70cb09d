# SPDX-License-Identifier: Apache-2.0
"""Instants in the fields of a table, exact to the nanosecond: counts from an epoch and ISO 8601, in several scales.

Stamps are nanoseconds of UTC since 1970 as ROS counts them, without leap seconds. Those between the scales come from
ERFA's table.
"""

import re
from collections.abc import Sequence
from datetime import date, timedelta
from decimal import Decimal
from functools import cache

import numpy as np

from css_common.epochs import parse_utc
from css_telemetry.description import TimeForm
from css_telemetry.faults import Broken
from css_telemetry.units import TIME_UNITS
from css_telemetry.values import MISSING, Column, is_number

_SECOND = 10**9
GPS_EPOCH_NS = 315_964_800 * _SECOND  # 1980-01-06
TAI_EPOCH_NS = -378_691_200 * _SECOND  # 1958-01-01
BOOT_NS = 86_400 * _SECOND
"""Stamp of a boot whose instant nobody told: the second day of 1970, so that it is plain that it is none."""
_GPS_BEHIND_TAI_NS = 19 * _SECOND
_WEEK_NS = 7 * 86_400 * _SECOND
UNIX_ERA_NS = 10**17  # smaller ones, before 1973, count from another epoch
_LARGEST = 1e19  # of a number that is a time in any unit
LAST_NS = 2**31 * _SECOND  # seconds of a stamp are 32 bits wide

_FRACTION = re.compile(r"(\d{2}:\d{2}:\d{2})[.,](\d+)", re.ASCII)
_DAY_OF_YEAR = re.compile(r"(\d{4})-?(\d{3})(?=T|\s|$)", re.ASCII)
_POINTED = re.compile(r"(\d{2})\.(\d{2})\.(\d{4})(?=T|\s|$)", re.ASCII)
_SLASHED = re.compile(r"(\d{4})/(\d{2})/(\d{2})(?=T|\s|$)", re.ASCII)
_UNIT_NAMES = {
    "s": "seconds", "ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds", "min": "minutes", "h": "hours",
    "d": "days",
}  # fmt: skip


def stamps_of(
    columns: Sequence[Column], form: TimeForm, decimal_comma: bool = False
) -> tuple[np.ndarray, list[tuple[int, Broken]]]:
    """Stamps of the lines of a table.

    Args:
        columns: one or two, (K,) fields each, as the form says.
        form: unit, scale and epoch.
        decimal_comma: counts have a comma in the place of the point.

    Returns:
        (K,) int64 nanoseconds, 0 where there is none; index and fault of each field that holds no time.
    """
    count = len(columns[0])
    stamps = np.zeros(count, np.int64)
    faults: list[tuple[int, Broken]] = []
    instants = _typed_instants(columns[0]) if len(columns) == 1 else None
    texts = None if instants is not None else [_texts(column) for column in columns]
    for index in range(count):
        try:
            if instants is not None:
                ns = int(instants[index])
                given = str(instants[index])
            else:
                assert texts is not None
                fields = [column[index] for column in texts]
                given = " ".join(fields)
                ns = _one(fields, form, decimal_comma)
            stamps[index] = _checked(to_utc(ns, form.scale), given, form)
        except Broken as fault:
            faults.append((index, fault))
    return stamps, faults


def _texts(column: Column) -> Sequence[str]:
    return column if not isinstance(column, np.ndarray) else [repr(value) for value in column.tolist()]


def _typed_instants(column: Column) -> np.ndarray | None:
    """Nanoseconds since 1970 of a column of instants of a file that has types."""
    if isinstance(column, np.ndarray) and column.dtype.kind == "M":
        return column.astype("datetime64[ns]").astype(np.int64)
    return None


def _one(fields: list[str], form: TimeForm, decimal_comma: bool) -> int:
    """Nanoseconds since 1970 in the scale of the form."""
    if any(field.lower() in MISSING for field in fields):
        raise Broken("no time", f"column {form.columns[0]}: {' '.join(fields)!r} found, expected a time")
    plain = [field.replace(",", ".") for field in fields] if decimal_comma else fields
    if len(fields) == 2 and form.scale == "gps" and all(map(is_number, plain)):
        return GPS_EPOCH_NS + int(_count_ns(plain[0], form, _WEEK_NS)) + _count_ns(plain[1], form)
    if len(fields) == 1 and is_number(plain[0]):
        return _epoch_of(form, plain[0]) + _count_ns(plain[0], form)
    text = "T".join(fields)
    try:
        return instant_ns(text)
    except (ValueError, OverflowError) as error:
        raise _no_time(text, form) from error


def _count_ns(text: str, form: TimeForm, unit_ns: int | None = None) -> int:
    size = abs(float(text))  # first, for the digits of an exponent have no bound
    if not size <= _LARGEST:
        raise _no_time(text, form)
    return round(Decimal(text) * (unit_ns or TIME_UNITS[form.unit])) if size > 1e-9 else 0


def _epoch_of(form: TimeForm, text: str) -> int:
    """Instant [ns since 1970, in the scale] from which counts count."""
    if form.epoch_ns is not None:
        return form.epoch_ns
    own = {"gps": GPS_EPOCH_NS, "tai": TAI_EPOCH_NS, "boot": BOOT_NS}.get(form.scale, 0)
    if not own and _count_ns(text, form) < UNIX_ERA_NS:
        raise Broken(
            "no epoch",
            f"column {form.columns[0]}: {text} {form.unit} is not a time since 1970; --epoch, or time: epoch, names "
            "its beginning",
        )
    return own


def instant_ns(text: str) -> int:
    """Nanoseconds since 1970 of an ISO 8601 instant with the day of a month or of a year.

    Python's reader knows no day of a year, and drops what is below a microsecond.

    Raises:
        ValueError: it is none.
    """
    text = _POINTED.sub(r"\3-\2-\1", _SLASHED.sub(r"\1-\2-\3", text.strip()))
    day = _DAY_OF_YEAR.match(text)
    if day:
        year, number = int(day.group(1)), int(day.group(2))
        first = date(year, 1, 1)
        if not 1 <= number <= (date(year, 12, 31) - first).days + 1:
            raise ValueError(f"{text!r}: {year} has no day {number}")
        text = f"{first + timedelta(days=number - 1)}{text[day.end() :]}"
    fraction = _FRACTION.search(text)
    if fraction is None:
        return parse_utc(text)
    whole = text[: fraction.start()] + fraction.group(1) + text[fraction.end() :]
    return parse_utc(whole) + int(f"{fraction.group(2):0<9}"[:9])


def to_utc(ns: int, scale: str) -> int:
    """Nanoseconds since 1970 of UTC, of those of another scale that also counts days of 86400 s from 1970."""
    if scale not in ("gps", "tai"):
        return ns
    tai_ns = ns + (_GPS_BEHIND_TAI_NS if scale == "gps" else 0)
    begins, offsets = _leap_seconds()
    # the offset that is in force at the instant: its beginning is told in UTC
    place = int(np.searchsorted(begins + offsets, tai_ns, side="right")) - 1
    return tai_ns - int(offsets[max(place, 0)])


@cache
def _leap_seconds() -> tuple[np.ndarray, np.ndarray]:
    """Beginnings of the offsets of TAI to UTC [ns of UTC since 1970], and the offsets [ns], from 1972 on."""
    import erfa

    table = erfa.leap_seconds.get()
    table = table[table["year"] >= 1972]
    days = [(date(int(row["year"]), int(row["month"]), 1) - date(1970, 1, 1)).days for row in table]
    begins = np.array(days, np.int64) * 86_400 * _SECOND
    return begins, np.round(table["tai_utc"]).astype(np.int64) * _SECOND


def _checked(stamp_ns: int, text: str, form: TimeForm) -> int:
    if not 0 < stamp_ns < LAST_NS:
        hint = _other_unit(text, form.unit)
        raise Broken("no time", f"column {form.columns[0]}: {text} is outside of 1970 to 2038{hint}")
    return stamp_ns


def _no_time(text: str, form: TimeForm) -> Broken:
    expected = f"expected {_UNIT_NAMES[form.unit]} or an instant such as 2013-06-01T00:00:00Z"
    return Broken("no time", f"column {form.columns[0]}: {text!r} found, {expected}")


def _other_unit(text: str, unit: str) -> str:
    """A hint at the unit in which a count is a time of our days."""
    if is_number(text):
        for other in ("s", "ms", "us", "ns"):
            if other != unit and UNIX_ERA_NS * 7 < float(text) * TIME_UNITS[other] < LAST_NS:
                return f"; it is a time since 1970 in {other}: --time-unit {other}"
    return ""
