# SPDX-License-Identifier: Apache-2.0
"""A whole record of slit pulses at once: the passages that its pulses make, and what was refused."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from css_estimation.spin import slit_measurement, slit_passage
from css_estimation.spin.coning import Passages
from css_estimation.spin.slit_measurement import HALF_COUNT, SlitParameters
from css_estimation.spin.slit_passage import REASON_NONE, REASON_UNKNOWN
from css_estimation.spin.slit_timer_counts import UnwrappedTimer


@dataclass
class SlitRecord:
    """What a record of pulses tells.

    Attributes:
        passages: accepted, in the order of time; times [s] count from the timer's zero.
        sigma: (M,) 1 sigma of each Sun angle [rad].
        sun_b: (M, 3) direction to the Sun at each passage.
        covariance: (M, 6) of `sun_b`, upper triangle.
        pulses: number of pulses.
        refused: how many pulses and passages were refused, by reason.
    """

    passages: Passages
    sigma: np.ndarray
    sun_b: np.ndarray
    covariance: np.ndarray
    pulses: int = 0
    refused: Counter[int] = field(default_factory=Counter)


def read_record(
    p: SlitParameters, pulses: Iterable[tuple[int, int, int]], head_azimuths: Iterable[float]
) -> SlitRecord:
    """Passages of a record, by the functions that fly.

    Args:
        p: as of the node `slit_sun_angle`.
        pulses: slit (UPPER, VERTICAL, LOWER), count of the 32-bit timer and head of each pulse, in their order.
        head_azimuths: [rad] around the spin axis.
    """
    azimuths = list(head_azimuths)
    heads = [slit_passage.initial_state() for _ in azimuths]
    swing = slit_measurement.initial_swing(p)
    timer = UnwrappedTimer()
    refused: Counter[int] = Counter()
    rows, number = [], 0
    for slit, count, head in pulses:
        number += 1
        if not 0 <= head < len(heads):
            refused[REASON_UNKNOWN] += 1
            continue
        heads[head], passage = slit_passage.take_pulse(p.passage, heads[head], slit, timer.follow(count))
        if passage.reason != REASON_NONE:
            refused[passage.reason] += 1
        if passage.measured:
            swing, angle = slit_measurement.measure(p, swing, passage, azimuths[head])
            upper = (passage.upper - passage.vertical) / p.frequency
            rows.append(
                (
                    (passage.vertical + HALF_COUNT) / p.frequency,
                    angle.angle,
                    angle.rate,
                    upper,
                    upper + passage.interval / p.frequency,
                    azimuths[head],
                    angle.sigma,
                    *angle.sun_b,
                    *angle.covariance,
                )
            )
    rows.sort()
    columns = np.array(rows, dtype=np.float64).reshape(-1, 16).T
    return SlitRecord(Passages(*columns[:6]), columns[6], columns[7:10].T, columns[10:].T, number, refused)
