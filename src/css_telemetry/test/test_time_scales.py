# SPDX-License-Identifier: Apache-2.0
"""Times in the scales and units that spacecraft count in, against published pairs of instants."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from css_common.epochs import parse_utc
from css_telemetry.description import TimeForm
from css_telemetry.description_file import description_of
from css_telemetry.instants import BOOT_NS, instant_ns, stamps_of, to_utc
from css_telemetry.units import TIME_UNITS

SECOND = 10**9


def stamp(form, *fields):
    stamps, faults = stamps_of([[field] for field in fields], form)
    assert faults == []
    return int(stamps[0])


@pytest.mark.parametrize(
    ("form", "fields", "utc"),
    [
        # GPS week 2086 began 18 leap seconds before midnight of UTC
        (TimeForm(("t",), "s", "gps"), ["1261612800"], "2019-12-28T23:59:42Z"),
        (TimeForm(("week", "tow"), "s", "gps"), ["2086", "18"], "2019-12-29T00:00:00Z"),
        (TimeForm(("week", "tow"), "ms", "gps"), ["2086", "18500"], "2019-12-29T00:00:00.500Z"),
        (TimeForm(("t",), "s", "gps"), ["0"], "1980-01-06T00:00:00Z"),
        # 2016-12-31 had a leap second at its end: 17 before it, 18 after
        (TimeForm(("t",), "s", "gps"), ["1167264016"], "2016-12-31T23:59:59Z"),
        (TimeForm(("t",), "s", "gps"), ["1167264018"], "2017-01-01T00:00:00Z"),
        (TimeForm(("t",), "s", "tai"), ["1861920037"], "2017-01-01T00:00:00Z"),
        (TimeForm(("t",), "s", "tai"), ["2017-01-01T00:00:37"], "2017-01-01T00:00:00Z"),
        (TimeForm(("t",), "s", "gps"), ["2017-01-01T00:00:18"], "2017-01-01T00:00:00Z"),
        (TimeForm(("t",), "s", "tai", parse_utc("2000-01-01T12:00:00Z")), ["32.184"], "2000-01-01T12:00:00.184Z"),
        (TimeForm(("t",), "ms", "unix"), ["1700000000250"], "2023-11-14T22:13:20.250Z"),
        (TimeForm(("t",), "us"), ["1700000000250000"], "2023-11-14T22:13:20.250Z"),
        (TimeForm(("t",), "ns"), ["1700000000250000000"], "2023-11-14T22:13:20.250Z"),
        (TimeForm(("mjd",), "d", "epoch", instant_ns("1858-11-17T00:00:00Z")), ["60262.5"], "2023-11-14T12:00:00Z"),
        (TimeForm(("t",), "min", "boot", parse_utc("2024-03-20T12:00:00Z")), ["1.5"], "2024-03-20T12:01:30Z"),
        (TimeForm(("date", "time")), ["2024-03-20", "12:00:00.25"], "2024-03-20T12:00:00.250Z"),
        (TimeForm(("date", "time")), ["20.03.2024", "12:00:00"], "2024-03-20T12:00:00Z"),
        (TimeForm(("date", "time")), ["2024/03/20", "12:00:00Z"], "2024-03-20T12:00:00Z"),
        (TimeForm(("date", "time")), ["2024-080", "12:00:00"], "2024-03-20T12:00:00Z"),
        (TimeForm(("t",)), ["2024080T12:00:00"], "2024-03-20T12:00:00Z"),
    ],
)
def test_instants(form, fields, utc):
    assert stamp(form, *fields) == instant_ns(utc)


def test_a_boot_at_an_unknown_instant_begins_in_1970():
    assert stamp(TimeForm(("t",), "s", "boot"), "2.5") == BOOT_NS + 2_500_000_000


@settings(max_examples=200)
@given(st.integers(0, 2_000_000_000 * SECOND))
def test_leap_seconds_only_ever_take_away_and_time_goes_on(ns):
    later = ns + 7 * SECOND
    assert to_utc(ns, "utc") == ns
    # between GPS and UTC lie 0 to 18 s since 1980
    if ns > 400_000_000 * SECOND:
        assert 0 <= ns - to_utc(ns, "gps") <= 18 * SECOND
        assert 19 * SECOND <= ns - to_utc(ns, "tai") <= 37 * SECOND
        assert 6 * SECOND <= to_utc(later, "gps") - to_utc(ns, "gps") <= 7 * SECOND


@pytest.mark.parametrize(
    ("time", "words"),
    [
        ("{column: t, unit: fortnight}", "time.unit: 'fortnight' given, expected one of s, ms"),
        ("{column: t, scale: moon}", "time.scale: 'moon' given, expected one of utc, unix, gps, tai, epoch, boot"),
        ("{column: t, scale: epoch}", "expected epoch with the instant"),
        ("{column: t, epoch: soon}", "time.epoch: 'soon' given, expected an instant"),
        ("{unit: s}", "expected either column, or columns"),
        ("{column: t, columns: [a, b]}", "expected either column, or columns"),
        ("{columns: [a]}", "time.columns: ['a'] given, expected a list of 2"),
    ],
)
def test_wrong_entries_are_told(time, words):
    with pytest.raises(ValueError, match=re.escape(words)):
        description_of(f"cells: {{c: [1, 0, 0]}}\ntime: {time}\n")


def test_typed_columns_are_instants_too():
    column = np.array(["2024-03-20T12:00:00.123456789"], "datetime64[ns]")
    stamps, faults = stamps_of([column], TimeForm(("t",)))
    assert stamps[0] == instant_ns("2024-03-20T12:00:00.123456789Z") and faults == []
    assert set(TIME_UNITS) == {"s", "ms", "us", "ns", "min", "h", "d"}
