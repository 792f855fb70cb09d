# SPDX-License-Identifier: Apache-2.0
"""Tachometers of the reaction wheels: what they report of the true speeds, with noise and in whole steps."""

import math
from typing import NamedTuple

from css_common.declared import builder, made, table_of
from css_common.kernel import kernel
from css_common.random_streams import RandomKey, Stream
from css_common.schema import real
from css_sim.fault_effects import TACHOMETER, spoil
from css_sim.three_axes import read_out_one
from css_sim.white_noise import add_noise


def _per_second(speed_rpm: float) -> float:
    return speed_rpm * 2.0 * math.pi / 60.0


class Tachometer(NamedTuple):
    """Errors of all tachometers [rad/s]."""

    noise: float = made(
        _per_second,
        real("tachometer.noise_rpm", 0.0, "rpm", "1 sigma of the white noise of a reported speed", low=0.0, high=1e4),
    )
    resolution: float = made(
        _per_second,
        real("tachometer.resolution_rpm", 0.0, "rpm", "step of a reported speed; 0: continuous", low=0.0, high=1e4),
    )


PARAMETERS = table_of(Tachometer)
parameters = builder(Tachometer)


def errs(p: Tachometer) -> bool:
    """Whether reported speeds are other than the true ones."""
    return p.noise > 0.0 or p.resolution > 0.0


@kernel
def report(p: Tachometer, faults, key: RandomKey, step: int, speeds) -> None:
    """Turns the true speeds (N,) [rad/s] of a control cycle into those that are reported.

    Args:
        faults: (F,) of `fault_effects.FAULT`.
    """
    if p.noise > 0.0:
        add_noise(p.noise, key, Stream.TACHOMETER, step, speeds)
    if faults.shape[0] > 0:
        spoil(faults, TACHOMETER, key, step, speeds)
    if p.resolution > 0.0:
        for i in range(speeds.shape[0]):
            speeds[i] = read_out_one(p.resolution, 0.0, speeds[i])
