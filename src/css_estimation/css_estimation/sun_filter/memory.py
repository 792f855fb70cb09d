# SPDX-License-Identifier: Apache-2.0
"""Arrays that the Sun filter carries from cycle to cycle, and what stands where in them.

A hypothesis is an attitude with all that goes with it. Its error state, of which the covariance is, has

    THETA    3   attitude error [rad] in n: dcm_bn = dcm_bn(estimated) (1 - [theta x])
    RATE     3   by `RATE_*` of `motion`: gyro bias [rad/s], angular momentum [N m s] or rate [rad/s], in b
    SCALE    1   slow error of the output common to all cells
    COMMON   1   error of the output common to all cells in this cycle alone
    EARTH    1   error of all reflectivities in common
    GAIN     N   lasting error of the output of each cell
    then     N   error of the Earth's light on each cell, in units of its standard deviation
    and      3 N of each cell the error of its gain and two tilts [rad] of its normal (`calibration`), where they are
                 estimated or considered

In n the direction that cells cannot see, the turn about the Sun line, is the same at all times and after all updates:
a large variance along it stays there.
"""

from typing import NamedTuple

import numpy as np

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3
from css_environment.albedo import new_workspace

THETA, RATE, SCALE, COMMON, EARTH, GAIN = 0, 3, 6, 7, 8, 9

# The estimate itself: nine elements of dcm_bn, the three of RATE, then SCALE, EARTH, and those of the cells.
X_RATE, X_SCALE, X_EARTH, X_GAIN = 9, 12, 13, 14

HYPOTHESES = 12
"""Attitudes that are followed at a time while the turn about the Sun line is looked for."""

DIRECTIONS = 500
"""Directions among which the Sun is looked for: 9 deg from one to the next."""

DEAD = -1e300
"""Weight of a hypothesis that is not followed any more."""


class SunFilterMemory(NamedTuple):
    """Of N cells; all written by `sun_filter.step`."""

    estimates: np.ndarray  # (HYPOTHESES, 14 + 2 N + C), C the states of calibration, 0 or 3 N
    covariances: np.ndarray  # (HYPOTHESES, 9 + 2 N + C, 9 + 2 N + C)
    weights: np.ndarray  # (HYPOTHESES,) logarithms, DEAD for those that are not followed
    grid: np.ndarray  # (DIRECTIONS,) logarithms of the weights of directions to the Sun
    earth: np.ndarray  # (N,) light of the Earth on each cell [-]
    earth_slopes: np.ndarray  # (N, 3) its derivatives to a turn of the body [1/rad]
    earth_work: np.ndarray  # (224,) of `css_environment.albedo.new_workspace`
    work: np.ndarray  # (3, 9 + 2 N + C)
    sunlight: np.ndarray  # (N,) of this cycle, on each cell [-]


def new_memory(cells: int, calibrated: int = 0) -> SunFilterMemory:
    """Zeros, and one hypothesis with the frames b and n in line, of cells with so many states of calibration each."""
    states = GAIN + (2 + calibrated) * cells
    estimates = np.zeros((HYPOTHESES, X_GAIN + (2 + calibrated) * cells))
    estimates[:, [0, 4, 8]] = 1.0
    return SunFilterMemory(
        estimates,
        np.zeros((HYPOTHESES, states, states)),
        np.full(HYPOTHESES, DEAD),
        np.zeros(DIRECTIONS),
        np.zeros(cells),
        np.zeros((cells, 3)),
        new_workspace(),
        np.zeros((3, states)),
        np.zeros(cells),
    )


@kernel
def dcm_of(x) -> Mat3:
    """The attitude of an estimate."""
    return (x[0], x[1], x[2]), (x[3], x[4], x[5]), (x[6], x[7], x[8])


@kernel
def set_dcm(x, dcm_bn: Mat3) -> None:
    """Writes the attitude of an estimate."""
    for i in range(3):
        for j in range(3):
            x[3 * i + j] = dcm_bn[i][j]


@kernel
def triple(a, first: int) -> Vec3:
    """Three successive elements."""
    return a[first], a[first + 1], a[first + 2]


@kernel
def attitude_block(covariance) -> Mat3:
    """Covariance of THETA."""
    return triple(covariance[THETA], THETA), triple(covariance[THETA + 1], THETA), triple(covariance[THETA + 2], THETA)


@kernel
def forget(covariance, first: int, count: int, variance: float) -> None:
    """Makes some states uncorrelated with all others and each other, with a given variance."""
    for i in range(first, first + count):
        for j in range(covariance.shape[0]):
            covariance[i, j] = 0.0
            covariance[j, i] = 0.0
        covariance[i, i] = variance


@kernel
def quadratic(covariance, first: int, v: Vec3) -> float:
    """v^T P v of the 3 x 3 block at `first`."""
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += v[i] * covariance[first + i, first + j] * v[j]
    return total
