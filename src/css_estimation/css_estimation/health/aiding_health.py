# SPDX-License-Identifier: Apache-2.0
"""Stands before every Sun estimator: of what other sensors measured, what an estimator can trust."""

from typing import NamedTuple

import numpy as np

from css_common.declared import builder, part, table_of
from css_common.health import SORT_GYRO, SORT_MAGNETOMETER, new_verdicts
from css_common.kernel import kernel
from css_common.vectors import Vec3
from css_estimation.health import field_health, gyro_state
from css_estimation.health.field_health import FieldHealthParameters, FieldState, check_field
from css_estimation.health.gyro_fit import new_fits
from css_estimation.health.gyro_health import check_gyro, unheard
from css_estimation.health.gyro_state import GyroHealthParameters, GyroState
from css_estimation.health.gyroless_sight import Glimpse
from css_estimation.health.rate_checks import new_axes
from css_estimation.sun.sun_heading import HELD_FIELD, HELD_GYRO, LEFT_FIELD, LEFT_GYRO, Aiding


class AidingHealthParameters(NamedTuple):
    """Of gyro and magnetometer."""

    gyro: GyroHealthParameters = part(GyroHealthParameters)
    field: FieldHealthParameters = part(FieldHealthParameters)


PARAMETERS = table_of(AidingHealthParameters)
parameters = builder(AidingHealthParameters)


class Trusted(NamedTuple):
    """What takes the place of the same fields of `Aiding`; kernels hand no arrays back, and that has some."""

    gyro_b: Vec3
    gyro_valid: bool
    field_b: Vec3
    field_valid: bool
    left: int  # LEFT_* and HELD_*, added: what it had to do without, and what has axes that are held for failed


class AidingHealthState(NamedTuple):
    """From cycle to cycle."""

    step: int  # cycles so far
    gyro: GyroState
    field: FieldState


class AidingHealthMemory(NamedTuple):
    """Arrays that are advanced in place."""

    axes: np.ndarray  # (3,) of GYRO_AXIS
    fits: np.ndarray  # of `gyro_fit`
    gyro_verdicts: np.ndarray  # (3,) of VERDICT
    field_axes: np.ndarray  # (3,) of GYRO_AXIS
    field_verdicts: np.ndarray  # (3,) of VERDICT
    changes: np.ndarray  # (1,) how often verdicts have changed
    told: np.ndarray  # (1,) sum over the verdicts of the last cycle
    no_speeds: np.ndarray  # (0,) of wheels that nobody reckons with


def initial_state(p: AidingHealthParameters) -> AidingHealthState:
    """Everything is trusted."""
    return AidingHealthState(0, gyro_state.initial_state(p.gyro), field_health.initial_state(p.field))


def initial_memory(p: AidingHealthParameters) -> AidingHealthMemory:
    """Nothing held for failed."""
    return AidingHealthMemory(
        new_axes(),
        new_fits(),
        new_verdicts(SORT_GYRO, 3),
        new_axes(),
        new_verdicts(SORT_MAGNETOMETER, 3),
        np.zeros(1, np.int64),
        np.zeros(1, np.int64),
        np.zeros(0),
    )


@kernel
def _sum_of(verdicts) -> int:
    """A number that is another one for other verdicts (3,); 0: none is held."""
    total = 0
    for i in range(3):
        v = verdicts[i]
        if v.held != 0:
            total += (i + 1) * (1 + v.kind + 1000 * v.evidence + 100_000 * v.since_step)
    return total


@kernel
def check_aiding(
    p: AidingHealthParameters,
    state: AidingHealthState,
    memory: AidingHealthMemory,
    dt: float,
    aiding: Aiding,
    sight: Glimpse,
    misfits: bool,
    gyro_used: bool,
) -> tuple[AidingHealthState, Trusted]:
    """State, and what can be trusted.

    Args:
        dt: [s] since the last cycle.
        aiding: as measured.
        sight: the Sun by the cells alone, of the last cycle.
        misfits: the cells contradict a Sun line that the gyro leads.
        gyro_used: somebody listens to it; else nobody asks whether it is right.
    """
    step = state.step + 1
    gyro, gyro_b, gyro_valid, gyro_left = state.gyro, aiding.gyro_b, aiding.gyro_valid, False
    if not gyro_used:
        gyro = unheard(gyro, memory.axes)
    else:
        gyro, gyro_b, gyro_valid, gyro_left = check_gyro(
            p.gyro,
            gyro,
            memory.axes,
            memory.fits,
            memory.gyro_verdicts,
            dt,
            step,
            gyro_b,
            gyro_valid,
            sight,
            misfits,
        )
    field, field_b, field_valid, field_left = check_field(
        p.field,
        state.field,
        memory.field_axes,
        memory.field_verdicts,
        dt,
        step,
        aiding.field_b,
        aiding.field_valid,
        aiding.sky,
        sight,
    )
    of_gyro, of_field = _sum_of(memory.gyro_verdicts), _sum_of(memory.field_verdicts)
    left = (LEFT_GYRO if gyro_left else 0) + (LEFT_FIELD if field_left else 0)
    left += (HELD_GYRO if of_gyro != 0 else 0) + (HELD_FIELD if of_field != 0 else 0)
    told = of_gyro + 7 * of_field
    if told != memory.told[0]:
        memory.told[0] = told
        memory.changes[0] += 1
    return AidingHealthState(step, gyro, field), Trusted(gyro_b, gyro_valid, field_b, field_valid, left)
