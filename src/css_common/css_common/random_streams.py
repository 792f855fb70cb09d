# SPDX-License-Identifier: Apache-2.0
"""Counter-based random numbers: a draw is a function of (seed, case, stream, step, index) and of nothing else.

Philox4x32-10 (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC11) turns a counter of four
words and a key of two into four random words. Nothing is carried from draw to draw, so a case does not depend
on threads, on the order of cases or on a node that was restarted half-way, and two sensors never share noise.
"""

import math
from enum import IntEnum
from typing import NamedTuple

import numba
import numpy as np

from css_common.kernel import kernel


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


# Coefficients of Wichura's rational approximations, highest power first.
_CENTRE_NUMERATOR = (
    2509.0809287301226727, 33430.575583588128105, 67265.770927008700853, 45921.953931549871457,
    13731.693765509461125, 1971.5909503065514427, 133.14166789178437745, 3.387132872796366608,
)  # fmt: skip
_CENTRE_DENOMINATOR = (
    5226.495278852545925, 28729.085735721942674, 39307.89580009271061, 21213.794301586595867,
    5394.1960214247511077, 687.1870074920579083, 42.313330701600911252, 1.0,
)  # fmt: skip
_MIDDLE_NUMERATOR = (
    7.7454501427834140764e-4, 0.0227238449892691845833, 0.24178072517745061177, 1.27045825245236838258,
    3.64784832476320460504, 5.7694972214606914055, 4.6303378461565452959, 1.42343711074968357734,
)  # fmt: skip
_MIDDLE_DENOMINATOR = (
    1.05075007164441684324e-9, 5.475938084995344946e-4, 0.0151986665636164571966, 0.14810397642748007459,
    0.68976733498510000455, 1.6763848301838038494, 2.05319162663775882187, 1.0,
)  # fmt: skip
_TAIL_NUMERATOR = (
    2.01033439929228813265e-7, 2.71155556874348757815e-5, 0.0012426609473880784386, 0.026532189526576123093,
    0.29656057182850489123, 1.7848265399172913358, 5.4637849111641143699, 6.6579046435011037772,
)  # fmt: skip
_TAIL_DENOMINATOR = (
    2.04426310338993978564e-15, 1.4215117583164458887e-7, 1.8463183175100546818e-5, 7.868691311456132591e-4,
    0.0148753612908506148525, 0.13692988092273580531, 0.59983220655588793769, 1.0,
)  # fmt: skip


@kernel
def _polynomial(coefficients, x: float) -> float:
    value = coefficients[0]
    for i in range(1, 8):
        value = value * x + coefficients[i]
    return value


@kernel
def normal_quantile(p: float) -> float:
    """Inverse of the standard normal distribution, relative error 1e-15 (Wichura 1988, algorithm AS 241)."""
    q = p - 0.5
    if abs(q) <= 0.425:
        r = 0.180625 - q * q
        return q * _polynomial(_CENTRE_NUMERATOR, r) / _polynomial(_CENTRE_DENOMINATOR, r)
    r = math.sqrt(-math.log(p if q < 0.0 else 1.0 - p))
    if r <= 5.0:
        value = _polynomial(_MIDDLE_NUMERATOR, r - 1.6) / _polynomial(_MIDDLE_DENOMINATOR, r - 1.6)
    else:
        value = _polynomial(_TAIL_NUMERATOR, r - 5.0) / _polynomial(_TAIL_DENOMINATOR, r - 5.0)
    return -value if q < 0.0 else value


@kernel
def normal4(key: RandomKey, stream: int, step: int, index: int) -> tuple[float, float, float, float]:
    """Four independent standard normal numbers."""
    u0, u1, u2, u3 = uniform4(key, stream, step, index)
    return (normal_quantile(u0), normal_quantile(u1), normal_quantile(u2), normal_quantile(u3))
