# SPDX-License-Identifier: Apache-2.0
"""Counter-based random numbers: a draw is a function of (seed, case, stream, step, index) and of nothing else.

Philox4x32-10 (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC11) turns a counter of four
words and a key of two into four random words. Nothing is carried from draw to draw, so a case does not depend
on threads, on the order of cases or on a node that was restarted half-way, and two sensors never share noise.
"""

from enum import IntEnum
from typing import NamedTuple

import numba
import numpy as np

from css_common.kernel import kernel
from css_common.normal_distribution import normal_quantile


class Stream(IntEnum):
    """The fixed table of streams. A number, once given, is never given to another use."""

    INITIAL_ATTITUDE = 1
    INITIAL_RATE = 2
    CELL_DEGRADATION = 3
    CELL_NOISE = 4
    CELL_SCALE = 5
    CELL_MISALIGNMENT = 6
    GYRO_BIAS = 7
    GYRO_NOISE = 8
    MAGNETOMETER_BIAS = 9
    MAGNETOMETER_NOISE = 10
    ALBEDO = 11
    CELL_FAILURE = 12
    INERTIA = 13
    WHEEL_LIMIT = 14
    ATTITUDE_GUESS = 15
    DIPOLE = 16
    ORBIT = 17
    LATENCY = 18
    TACHOMETER = 19
    WHEEL_FRICTION = 20
    SLIT_JITTER = 21
    SLIT_FAULT = 22
    SPIN_PHASE = 23
    CLOUDS = 24
    EPOCH = 25
    FAULT = 26
    LINK_FAULT = 27
    HEAD_FAULT = 28
    DISPERSION = 29


class RandomKey(NamedTuple):
    """What is common to all draws of one case."""

    seed_low: np.uint32
    seed_high: np.uint32
    case: np.uint32


def random_key(seed: int, case: int) -> RandomKey:
    """Key of one case of a study.

    Args:
        seed: 0 to 2**64 - 1.
        case: 0 to 2**32 - 1.
    """
    return RandomKey(np.uint32(seed & 0xFFFFFFFF), np.uint32(seed >> 32), np.uint32(case))


_M0 = np.uint64(0xD2511F53)
_M1 = np.uint64(0xCD9E8D57)
_W0 = np.uint32(0x9E3779B9)
_W1 = np.uint32(0xBB67AE85)
_SHIFT = np.uint64(32)


@kernel
def philox4x32(c0, c1, c2, c3, k0, k1) -> tuple[int, int, int, int]:
    """Ten rounds of Philox4x32: four uint32 words of counter and two of key in, four uint32 words out."""
    c0, c1, c2, c3 = numba.uint32(c0), numba.uint32(c1), numba.uint32(c2), numba.uint32(c3)
    k0, k1 = numba.uint32(k0), numba.uint32(k1)
    for _ in range(10):
        p0 = _M0 * numba.uint64(c0)
        p1 = _M1 * numba.uint64(c2)
        n0 = numba.uint32(numba.uint32(p1 >> _SHIFT) ^ c1 ^ k0)
        n2 = numba.uint32(numba.uint32(p0 >> _SHIFT) ^ c3 ^ k1)
        c1 = numba.uint32(p1)
        c3 = numba.uint32(p0)
        c0 = n0
        c2 = n2
        k0 = numba.uint32(k0 + _W0)
        k1 = numba.uint32(k1 + _W1)
    return c0, c1, c2, c3


_TO_UNIT = 2.0**-32


@kernel
def uniform4(key: RandomKey, stream: int, step: int, index: int) -> tuple[float, float, float, float]:
    """Four numbers in the open interval (0, 1), 32 bits each."""
    r0, r1, r2, r3 = philox4x32(key.case, stream, step, index, key.seed_low, key.seed_high)
    return (
        (r0 + 0.5) * _TO_UNIT,
        (r1 + 0.5) * _TO_UNIT,
        (r2 + 0.5) * _TO_UNIT,
        (r3 + 0.5) * _TO_UNIT,
    )


@kernel
def normal4(key: RandomKey, stream: int, step: int, index: int) -> tuple[float, float, float, float]:
    """Four independent standard normal numbers."""
    u0, u1, u2, u3 = uniform4(key, stream, step, index)
    return (normal_quantile(u0), normal_quantile(u1), normal_quantile(u2), normal_quantile(u3))
