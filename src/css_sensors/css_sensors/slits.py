# SPDX-License-Identifier: Apache-2.0
"""The slits of a spinning payload and the timer behind them (Reichard et al., ESPRIT, Figs. 1 to 3)."""

import math
from collections.abc import Iterator

import numpy as np

from css_common.schema import Table, Values, real, reals

UPPER, VERTICAL, LOWER = 0, 1, 2
"""Slits of a head, as in css_msgs/SlitPulse."""

SLITS_PER_HEAD = 3
MOST_HEADS = 8

TIMER_SPAN = 2**32
"""Counts after which the timer begins anew."""

_HALF_SPAN = TIMER_SPAN // 2

COUNTER = real("slits.counter_hz", 1e6, "Hz", "frequency of the timer", low=1e3, high=1e9)
INCLINATION = real(
    "slits.inclination_deg", 30.0, "deg", "of the two slanted slits to the spin axis", low=5.0, high=85.0
)
FIELD_OF_VIEW = real(
    "slits.field_of_view_deg",
    120.0,
    "deg",
    "range of Sun angles over which a slit is lit, about the equator",
    low=2.0,
    high=179.0,
)
HEAD_AZIMUTHS = reals(
    "slits.head_azimuths_deg",
    (0.0,),
    "deg",
    f"places of the sensor heads around the spin axis, at most {MOST_HEADS}",
    low=-360.0,
    high=360.0,
)

SLITS: Table = (
    COUNTER,
    INCLINATION,
    FIELD_OF_VIEW,
    HEAD_AZIMUTHS,
)


def conflicts(slits: Values) -> Iterator[str]:
    """What is wrong between the values of the section, one message each."""
    heads = slits.head_azimuths_deg
    if not 1 <= len(heads) <= MOST_HEADS:
        yield f"slits.head_azimuths_deg: {len(heads)} given, expected 1 to {MOST_HEADS}"
    elif len(np.unique(np.round(np.mod(heads, 360.0), 6))) != len(heads):
        yield "slits.head_azimuths_deg: two heads at one place, expected different azimuths"


def timer_frequency(values: Values) -> float:
    """Frequency of the timer [Hz]."""
    return values[COUNTER]


def slit_inclination(values: Values) -> float:
    """Inclination of the slanted slits to the spin axis [rad]."""
    return math.radians(values[INCLINATION])


def head_azimuths(values: Values) -> list[float]:
    """Places of the heads around the spin axis [rad]."""
    azimuths: list[float] = np.radians(values[HEAD_AZIMUTHS]).tolist()
    return azimuths


def counts_between(later: int, earlier: int) -> int:
    """Difference of two readings of the timer that are less than half a span apart, whichever is the later one."""
    return (later - earlier + _HALF_SPAN) % TIMER_SPAN - _HALF_SPAN
