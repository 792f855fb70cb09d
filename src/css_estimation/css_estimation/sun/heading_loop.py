# SPDX-License-Identifier: Apache-2.0
"""A Sun estimator stepped through many cycles whose inputs are known, in one compiled loop."""

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from css_common.kernel import Kernel, kernel_of
from css_common.vectors import row
from css_estimation.sun.heading_dispatch import estimate_heading
from css_estimation.sun.sky_table import sky_at
from css_estimation.sun.sun_heading import Aiding, Measured


class Headings(NamedTuple):
    """`SunHeading` of M cycles."""

    sun_b: np.ndarray  # (M, 3)
    covariance: np.ndarray  # (M, 9)
    omega_bn_b: np.ndarray  # (M, 3)
    age: np.ndarray  # (M,), like all that follow
    nis: np.ndarray
    nis_dof: np.ndarray
    lit_mask: np.ndarray
    validity: np.ndarray
    rate_source: np.ndarray
    eclipse: np.ndarray
    mode: np.ndarray
    isolated: np.ndarray
    sensors_left: np.ndarray


def new_headings(count: int) -> Headings:
    """Room for as many."""
    vectors = (np.zeros((count, size)) for size in (3, 9, 3))
    reals = (np.zeros(count) for _ in range(2))
    return Headings(*vectors, *reals, *(np.zeros(count, np.int64) for _ in range(8)))


@cache
def loop_of(algorithm: str) -> "Kernel":
    """The loop for the `SunAlgorithm` of a module; arguments in `_advance`."""
    return kernel_of(_advance, algorithm)


@cache
def cycle_of(algorithm: str) -> "Kernel":
    """One cycle of the `SunAlgorithm` of a module; arguments as of `estimate_heading`."""
    return kernel_of(_cycle, algorithm)


def _cycle(p: Any, state: Any, memory: Any, dt: float, voltages: Any, aiding: Aiding) -> Any:
    return estimate_heading(p, state, memory, dt, voltages, aiding)


def _advance(p: Any, state: Any, memory: Any, since_s, measured: Measured, sky, sky_light, out: Headings) -> Any:
    """The state after all cycles.

    Args:
        p, state, memory: of the algorithm.
        since_s: (M,) [s] since the cycle before.
        measured: what each cycle is given.
        sky, sky_light: of `sky_table` for the stamps of the cycles.
        out: what each came to, written.
    """
    for k in range(since_s.shape[0]):
        aiding = Aiding(
            row(measured.gyro_b, k),
            measured.gyro_valid[k],
            row(measured.field_b, k),
            measured.field_valid[k],
            measured.wheel_speeds[k],
            measured.wheels_valid,
            sky_at(sky, sky_light, k),
        )
        state, heading = estimate_heading(p, state, memory, since_s[k], measured.voltages[k], aiding)
        for i in range(3):
            out.sun_b[k, i], out.omega_bn_b[k, i] = heading.sun_b[i], heading.omega_bn_b[i]
        for i in range(9):
            out.covariance[k, i] = heading.covariance[i]
        out.age[k], out.nis[k] = heading.age, heading.nis
        out.nis_dof[k], out.lit_mask[k] = heading.nis_dof, heading.lit_mask
        out.validity[k], out.rate_source[k] = heading.validity, heading.rate_source
        out.eclipse[k], out.mode[k] = heading.eclipse, heading.mode
        out.isolated[k], out.sensors_left[k] = heading.isolated, heading.sensors_left
    return state
