# SPDX-License-Identifier: Apache-2.0
"""Time scales at a simulated instant, as the two-part Julian dates ERFA takes.

An instant is an epoch in UTC (nanoseconds since 1970-01-01, leap seconds not counted: what ROS stamps hold)
plus elapsed SI seconds. Leap seconds are applied at the epoch, once: time runs evenly through a flight.
UT1 is taken equal to UTC: at most 0.9 s, which is 0.004 deg of Earth rotation. Years for which no leap seconds are
announced yet have those known: ERFA's warning about them is not passed on, for a second moves the Sun by 0.04 arcsec.
"""

import warnings
from typing import Any

import erfa
import numpy as np

UNIX_EPOCH_JD = 2_440_587.5
NANOSECONDS_PER_DAY = 86_400 * 10**9


def utc_date(epoch_ns: int, elapsed_s=0.0) -> tuple[float, Any]:
    """UTC (and UT1) as (whole days, fraction) of a Julian date; `elapsed_s` [s] is a float or an array."""
    days, rest_ns = divmod(int(epoch_ns), NANOSECONDS_PER_DAY)
    fraction = rest_ns / NANOSECONDS_PER_DAY + np.asarray(elapsed_s, dtype=float) / 86_400.0
    return UNIX_EPOCH_JD + days, fraction


def terrestrial_date(epoch_ns: int, elapsed_s=0.0) -> tuple[float, Any]:
    """Terrestrial time (taken for TDB too: they differ by 2 ms at most) as (whole days, fraction)."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*dubious year", erfa.ErfaWarning)
        tai = erfa.utctai(*utc_date(epoch_ns))
    days, fraction = erfa.taitt(*tai)
    return days, fraction + np.asarray(elapsed_s, dtype=float) / 86_400.0
