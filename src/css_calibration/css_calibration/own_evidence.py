# SPDX-License-Identifier: Apache-2.0
"""What outputs show by themselves, at the rate of the recording: leaps, and readings that stay the same."""

import math
from typing import NamedTuple

import numpy as np

from css_calibration.recorded import Recorded

_LEAPS = 5.0 * math.sqrt(6.0)
_LEAP_SHARE = 0.15
_FASTEST = 0.1  # [rad/s] of a body whose rate is not recorded
_BRIGHT = 0.1  # dark outputs are the same for ever
_SURE, _LONG = 30.0, 20  # -ln of the chance that a healthy cell repeats itself so, and samples
_FEWEST_OTHERS = 50


class OwnEvidence(NamedTuple):
    """Of N cells at M samples."""

    leaps: np.ndarray  # (M, N) of second differences
    same: np.ndarray  # (M, N) outputs that stay the same while others change

    def at(self, rows: np.ndarray) -> "OwnEvidence":
        """At some of the samples: set where it is for most from the one before on."""
        return OwnEvidence(_between(self.leaps, rows), _between(self.same, rows))


class Frozen(NamedTuple):
    """A cell that reads one number."""

    first: int  # sample
    last: int
    level: float


def own_evidence(recorded: Recorded) -> OwnEvidence:
    """Leaps and repetitions of all cells."""
    v = recorded.voltages
    leaps, same = np.zeros(v.shape, np.bool_), np.zeros(v.shape, np.bool_)
    second = np.abs(v[2:] - 2.0 * v[1:-1] + v[:-2])
    noise = 1.4826 * np.nanmedian(second, axis=0) / math.sqrt(6.0)
    largest = np.fmax(np.fmax(v[2:], v[1:-1]), v[:-2])
    # a body that turns by so much between samples makes second differences, too
    rates = np.linalg.norm(recorded.gyro_b, axis=1)
    turn = (float(np.percentile(rates, 95.0)) if len(rates) else _FASTEST) * recorded.period_s
    usual = max(float(np.nanmedian(noise)), 1e-4)
    limit = np.maximum(_LEAPS * usual, _LEAP_SHARE * largest) + 3.0 * min(turn, 0.3) ** 2
    leaps[2:] = second > limit
    same[1:] = v[1:] == v[:-1]
    changed = np.sum(~same & (np.abs(v) > _BRIGHT), axis=1)
    same &= (changed > 0)[:, None]
    return OwnEvidence(leaps, same)


def _between(flags: np.ndarray, rows: np.ndarray) -> np.ndarray:
    sums = np.vstack([np.zeros((1, flags.shape[1]), np.int64), np.cumsum(flags, axis=0)])
    before = np.concatenate([[-1], rows[:-1]])
    return (sums[rows + 1] - sums[before + 1]) > 0.3 * (rows - before)[:, None]


def frozen_cells(recorded: Recorded, evidence: OwnEvidence) -> dict[int, Frozen]:
    """Cells that read one number for far longer than the others, when as bright, ever would."""
    v = recorded.voltages
    bright = np.abs(v) > _BRIGHT
    bright[1:] &= np.abs(v[:-1]) > _BRIGHT
    bright[0] = False
    same, count = (evidence.same & bright).sum(axis=0), bright.sum(axis=0)
    found = {}
    for i in range(v.shape[1]):
        others = np.delete(count, i).sum()
        if others < _FEWEST_OTHERS:
            continue
        chance = (np.delete(same, i).sum() + 1.0) / (others + 2.0)
        first, last = _longest(evidence.same[:, i] & bright[:, i])
        length = last - first
        if length >= _LONG and -length * math.log(chance) > _SURE:
            found[i] = Frozen(first, last, float(v[last, i]))
    return found


def _longest(flags: np.ndarray) -> tuple[int, int]:
    """Samples before and at the end of the longest run of flags (M,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    if not len(edges):
        return 0, 0
    begins, ends = edges[::2], edges[1::2]
    longest = int(np.argmax(ends - begins))
    return int(begins[longest]) - 1, int(ends[longest]) - 1
