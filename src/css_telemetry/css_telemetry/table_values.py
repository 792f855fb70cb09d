# SPDX-License-Identifier: Apache-2.0
"""Numbers and instants in the fields of a table, exact to the nanosecond and strict: what is no number is refused."""

import math
import re
from datetime import date, timedelta
from decimal import Decimal

from css_common.epochs import parse_utc
from css_telemetry.table_forms import TIME_UNITS

_UNIT_NAMES = {"s": "seconds", "ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds"}

MISSING = frozenset(["", "nan", "na", "n/a", "#n/a", "null", "none", "nil", "-", "--"])
"""Fields, in small letters, that say that a value is missing."""

_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", re.ASCII)
_FRACTION = re.compile(r"(\d{2}:\d{2}:\d{2})[.,](\d+)", re.ASCII)
_DAY_OF_YEAR = re.compile(r"(\d{4})-(\d{3})(?=T|\s|$)", re.ASCII)
_UNIX_ERA_NS = 10**17  # smaller ones, before 1973, count from another epoch
_LARGEST = 1e19  # of a number that is a time in any unit
_LAST_NS = 2**31 * 10**9  # seconds of a stamp are 32 bits wide


class Broken(Exception):
    """A line of a table that cannot be used: kind of fault for counting, and the whole story."""

    def __init__(self, kind: str, detail: str) -> None:
        super().__init__(detail)
        self.kind = kind


def plain_number(text: str) -> float:
    """The value of a decimal number; infinity for any other text, such as 0x10, 1_000 or inf."""
    return float(text) if _NUMBER.fullmatch(text) else math.inf


def parse_number(text: str, column: str, decimal_comma: bool = False) -> float:
    """A number, NaN when it is missing.

    Raises:
        Broken: the field holds something else.
    """
    if text.lower() in MISSING:
        return math.nan
    value = plain_number(text.replace(",", ".") if decimal_comma else text)
    if not math.isfinite(value):
        raise Broken("no number", f"column {column}: {text!r} found, expected a number")
    return value


def parse_time(text: str, column: str, epoch_ns: int | None, unit: str = "s", decimal_comma: bool = False) -> int:
    """Nanoseconds since 1970 (UTC).

    Args:
        text: a count since the epoch, or an ISO 8601 instant with the day of a month or of a year.
        column: named in messages.
        epoch_ns: instant from which counts count; None: 1970.
        unit: of counts, one of `TIME_UNITS`.
        decimal_comma: counts have a comma in the place of the point.

    Raises:
        Broken: the field holds something else, or a time that no stamp can hold.
    """
    plain = text.replace(",", ".") if decimal_comma else text
    if _NUMBER.fullmatch(plain):
        stamp_ns = _counted(plain, column, epoch_ns, unit)
    else:
        try:
            stamp_ns = _instant(text)
        except (ValueError, OverflowError) as error:
            raise _no_time(text, column, unit) from error
    if not 0 < stamp_ns < _LAST_NS:
        raise Broken("no time", f"column {column}: {text} is outside of 1970 to 2038{_other_unit(plain, unit)}")
    return stamp_ns


def _counted(text: str, column: str, epoch_ns: int | None, unit: str) -> int:
    size = abs(float(text))  # first, for the digits of an exponent have no bound
    if not size <= _LARGEST:
        raise _no_time(text, column, unit)
    count_ns = round(Decimal(text) * TIME_UNITS[unit]) if size > 1e-9 else 0
    if epoch_ns is None and count_ns < _UNIX_ERA_NS:
        raise Broken(
            "no epoch", f"column {column}: {text} {unit} is not a time since 1970; --epoch names its beginning"
        )
    return (epoch_ns or 0) + count_ns


def _instant(text: str) -> int:
    """An ISO 8601 instant; the library's reader knows no day of a year, and drops what is below a microsecond."""
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


def _no_time(text: str, column: str, unit: str) -> Broken:
    expected = f"expected {_UNIT_NAMES[unit]} or an instant such as 2013-06-01T00:00:00Z"
    return Broken("no time", f"column {column}: {text!r} found, {expected}")


def _other_unit(text: str, unit: str) -> str:
    """A hint at the unit in which a count is a time of our days."""
    if _NUMBER.fullmatch(text):
        for other, nanoseconds in TIME_UNITS.items():
            if other != unit and _UNIX_ERA_NS * 7 < float(text) * nanoseconds < _LAST_NS:
                return f"; it is a time since 1970 in {other}: --time-unit {other}"
    return ""
