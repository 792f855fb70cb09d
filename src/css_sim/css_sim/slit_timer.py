# SPDX-License-Identifier: Apache-2.0
"""The timer behind the slits: whole counts, jitter, pulses that are missed and pulses that come twice."""

import math
from typing import NamedTuple

from css_common.conversions import seconds
from css_common.declared import builder, computed, given, made, table_of
from css_common.kernel import kernel
from css_common.random_streams import RandomKey, Stream, normal4, uniform4
from css_common.schema import real
from css_sensors.slits import timer_frequency


class SlitTimer(NamedTuple):
    """Frequency and errors; times in seconds."""

    frequency: float = computed(timer_frequency)  # [Hz]
    jitter: float = made(
        seconds, real("jitter_us", 0.0, "us", "1 sigma of the delay of a pulse", low=0.0, high=1e4, tunable=True)
    )
    missed: float = given(
        real("missed", 0.0, "-", "probability that a crossing gives no pulse", low=0.0, high=1.0, tunable=True)
    )
    double: float = given(
        real("double", 0.0, "-", "probability that a crossing gives a second pulse", low=0.0, high=1.0, tunable=True)
    )
    double_delay: float = made(
        seconds, real("double_delay_us", 300.0, "us", "delay of a second pulse behind the first", low=1.0, high=1e5)
    )


PARAMETERS = table_of(SlitTimer)
parameters = builder(SlitTimer)


@kernel
def counts_since_epoch(p: SlitTimer, time: float) -> int:
    """Whole counts at a time [s after the epoch]; the timer starts at the epoch and is not wrapped here."""
    return math.floor(time * p.frequency)


@kernel
def read_pulses(p: SlitTimer, key: RandomKey, step: int, count: int, times, slits, heads, ticks_out, codes_out) -> int:
    """Pulses of the crossings of one control cycle, in the order of the timer.

    Args:
        step: number of the cycle, which decides the draws.
        count: crossings.
        times, slits, heads: (M,) of the crossings, as `slit_crossings` writes them.
        ticks_out: (2 M,) whole counts since the epoch, written.
        codes_out: (2 M, 2) slit and head, written.

    Returns:
        Number of pulses.
    """
    pulses = 0
    for i in range(count):
        chance = uniform4(key, Stream.SLIT_FAULT, step, i)
        if chance[0] < p.missed:
            continue
        time = times[i]
        if p.jitter > 0.0:
            time += p.jitter * normal4(key, Stream.SLIT_JITTER, step, i)[0]
        for repeat in range(2 if chance[1] < p.double else 1):
            ticks = max(0, counts_since_epoch(p, time + repeat * p.double_delay))
            at = pulses
            while at > 0 and ticks_out[at - 1] > ticks:
                ticks_out[at] = ticks_out[at - 1]
                codes_out[at, 0], codes_out[at, 1] = codes_out[at - 1, 0], codes_out[at - 1, 1]
                at -= 1
            ticks_out[at], codes_out[at, 0], codes_out[at, 1] = ticks, slits[i], heads[i]
            pulses += 1
    return pulses
