# SPDX-License-Identifier: Apache-2.0
"""Instants as integer nanoseconds of UTC since 1970, the clock of every ROS stamp."""

import re
from datetime import UTC, datetime, timedelta

from css_common.schema import Values, shown

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def parse_utc(text: str) -> int:
    """Nanoseconds since 1970 of an ISO 8601 instant; without an offset it is UTC.

    Raises:
        ValueError: the text is not an ISO 8601 date and time.
    """
    try:
        instant = datetime.fromisoformat(text)
    except ValueError as error:
        leap = "; ROS stamps know no leap second" if re.search(r"[0-9]:60(?![0-9])", text) else ""
        raise ValueError(f"{shown(text)} is not a UTC instant such as 2013-06-01T00:00:00Z{leap}") from error
    if instant.tzinfo is None:
        instant = instant.replace(tzinfo=UTC)
    return (instant - _EPOCH) // timedelta(microseconds=1) * 1000


def mission_epoch(mission: Values) -> int:
    """Nanoseconds since 1970 UTC of the first step of a case (section mission): a whole second of the days asked for.

    0 in the mission of nodes that ask for no epoch.

    Raises:
        ValueError: the epoch is not an ISO 8601 date and time.
    """
    begin = parse_utc(mission.epoch) if mission.epoch else 0
    if mission.epoch_spread_days <= 0.0:
        return begin
    from css_common.random_streams import Stream, random_key, uniform4  # compiled, which few missions need for this

    (part, *_) = uniform4(random_key(mission.seed, mission.case), Stream.EPOCH, 0, 0)
    return begin + int(part * mission.epoch_spread_days * 86_400.0) * 10**9


def format_utc(stamp_ns: int) -> str:
    """ISO 8601 text, to the microsecond, of nanoseconds since 1970."""
    return (_EPOCH + timedelta(microseconds=stamp_ns // 1000)).isoformat().replace("+00:00", "Z")
