# SPDX-License-Identifier: Apache-2.0
"""Instants against Python's calendar and known POSIX times."""

from datetime import UTC, datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from css_common.epochs import format_utc, parse_utc


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("1970-01-01T00:00:00Z", 0),
        ("2000-01-01T12:00:00Z", 946_728_000),
        ("2013-06-01T00:00:00Z", 1_370_044_800),
        ("2013-06-01T02:00:00+02:00", 1_370_044_800),
        ("2013-06-01T00:00:00", 1_370_044_800),
        ("2013-06-01", 1_370_044_800),
        ("2016-12-31T23:59:59Z", 1_483_228_799),
        ("1969-12-31T23:59:59Z", -1),
    ],
)
def test_known_instants(text, seconds):
    assert parse_utc(text) == seconds * 1_000_000_000


def test_fractions_are_exact():
    assert parse_utc("2013-06-01T00:00:00.100000Z") - parse_utc("2013-06-01T00:00:00Z") == 100_000_000


@pytest.mark.parametrize("text", ["", "tomorrow", "2013-13-01T00:00:00Z", "2016-12-31T23:59:60Z", "1370044800"])
def test_other_texts_are_refused_and_shown(text):
    with pytest.raises(ValueError, match="is not a UTC instant such as 2013-06-01T00:00:00Z") as caught:
        parse_utc(text)
    assert repr(text) in str(caught.value)


@given(st.datetimes(datetime(1970, 1, 1), datetime(2037, 12, 31), timezones=st.just(UTC)))
def test_text_and_back(instant):
    stamp = parse_utc(instant.isoformat())
    assert parse_utc(format_utc(stamp)) == stamp
    assert format_utc(stamp).endswith("Z")
