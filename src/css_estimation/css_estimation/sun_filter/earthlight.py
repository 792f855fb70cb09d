# SPDX-License-Identifier: Apache-2.0
"""Attitude about all three axes from cells and orbit alone: the Sun is one direction, the light of the Earth the other.

It is the attitude that the Sun filter carries anyway. While several turns about the Sun line are still followed there
is no attitude to tell (validity `NONE`): the one that leads may be wrong by any angle. Modes are those of `sun_filter`.
"""

from typing import NamedTuple

import numpy as np

from css_common.attitude import dcm_to_mrp
from css_common.declared import builder, given, merged, part, table_of
from css_common.kernel import kernel
from css_common.vectors import Vec3, matmul, multiply, transpose
from css_estimation.attitude.attitude_solution import (
    USED_GYRO,
    USED_SUN,
    VALIDITY_HELD,
    VALIDITY_NONE,
    VALIDITY_VALID,
    AttitudeSolution,
)
from css_estimation.health import cell_health
from css_estimation.health.cell_health import trust_cells
from css_estimation.health.cell_memory import CellHealthMemory, CellHealthState, new_memory
from css_estimation.health.cell_options import ENABLED, CellHealthParameters
from css_estimation.sun.sun_heading import RATE_GYRO, RATE_NONE, Aiding
from css_estimation.sun.sun_tracking import elapsed
from css_estimation.sun_filter import options, sun_filter
from css_estimation.sun_filter.filter_state import MODE_EARTH, SunFilterState
from css_estimation.sun_filter.hypotheses import the_only_one
from css_estimation.sun_filter.memory import RATE, THETA, X_RATE, SunFilterMemory, attitude_block, dcm_of, triple
from css_estimation.sun_filter.motion import RATE_BY_GYRO, gyro_usable
from css_estimation.sun_filter.options import SunFilterParameters
from css_estimation.sun_filter.sun_filter import knows_earth

conflicts = options.conflicts

AIDED_BY_SKY = True
"""`step` takes what a Sun estimator takes: `Aiding`, with the flight's own sky in it."""


class EarthlightParameters(NamedTuple):
    """The parameters of this filter: by their type a study finds it."""

    filter: SunFilterParameters = part(SunFilterParameters)
    judges_cells: bool = given(ENABLED)
    cells: CellHealthParameters = part(CellHealthParameters)


PARAMETERS = merged(options.PARAMETERS, table_of(EarthlightParameters))
parameters = builder(EarthlightParameters)

_NO_BIAS: Vec3 = (0.0, 0.0, 0.0)


class EarthlightState(NamedTuple):
    """Carried from cycle to cycle beside the memory."""

    filter: SunFilterState
    cells: CellHealthState
    omega_bn_b: Vec3  # [rad/s] of the last cycle
    rate_source: int  # of that


def initial_state(p: EarthlightParameters) -> EarthlightState:
    """Nothing known."""
    return EarthlightState(sun_filter.initial_state(p.filter), cell_health.initial_state(), (0.0, 0.0, 0.0), RATE_NONE)


class EarthlightMemory(NamedTuple):
    """Arrays that `step` advances in place."""

    filter: SunFilterMemory
    covariance: np.ndarray  # (6, 6) of the attitude error [rad, rotation vector in b] and the gyro bias [rad/s]
    health: CellHealthMemory


def initial_memory(p: EarthlightParameters) -> EarthlightMemory:
    """Nothing known."""
    return EarthlightMemory(
        sun_filter.initial_memory(p.filter), np.zeros((6, 6)), new_memory(len(p.cells.layout.cells))
    )


@kernel
def _write_covariance(p: SunFilterParameters, x, covariance, by_gyro: bool, out) -> None:
    """Covariance in b; without gyro that of its bias is what it was at the start."""
    dcm_bn = dcm_of(x)
    attitude = matmul(matmul(dcm_bn, attitude_block(covariance)), transpose(dcm_bn))
    for i in range(3):
        for j in range(3):
            out[i, j] = 0.5 * (attitude[i][j] + attitude[j][i])
            out[3 + i, 3 + j] = p.motion.gyro_bias if i == j else 0.0
            if by_gyro:
                out[3 + i, 3 + j] = 0.5 * (covariance[RATE + i, RATE + j] + covariance[RATE + j, RATE + i])
    for j in range(3):
        column = (covariance[THETA, RATE + j], covariance[THETA + 1, RATE + j], covariance[THETA + 2, RATE + j])
        turned = multiply(dcm_bn, column)
        for i in range(3):
            out[i, 3 + j] = out[3 + j, i] = turned[i] if by_gyro else 0.0


@kernel
def _judge_cells(
    p: EarthlightParameters, state: EarthlightState, memory: EarthlightMemory, dt: float, voltages, aiding: Aiding
) -> CellHealthState:
    """Health of the cells after this cycle; what can be trusted of their outputs is then in its memory."""
    by_gyro = gyro_usable(p.filter.motion, aiding)
    rate = aiding.gyro_b if by_gyro else state.omega_bn_b
    source = RATE_GYRO if by_gyro else state.rate_source
    return trust_cells(
        p.judges_cells, p.cells, state.cells, memory.health, elapsed(dt), voltages, rate, source, aiding.sky
    )


@kernel
def step(
    p: EarthlightParameters, state: EarthlightState, memory: EarthlightMemory, dt: float, voltages, aiding: Aiding
) -> tuple[EarthlightState, AttitudeSolution]:
    """One cycle; arguments in `css_estimation.sun.sun_algorithm`."""
    cells = _judge_cells(p, state, memory, dt, voltages, aiding)
    after, heading = sun_filter.step(p.filter, state.filter, memory.filter, dt, memory.health.trusted, aiding)
    k = the_only_one(memory.filter)
    by_gyro = after.rate.model == RATE_BY_GYRO
    validity, used = VALIDITY_NONE, 0
    sigma_bn, bias_b = (0.0, 0.0, 0.0), _NO_BIAS
    if k >= 0 and knows_earth(after):
        x = memory.filter.estimates[k]
        sigma_bn = dcm_to_mrp(dcm_of(x))
        bias_b = triple(x, X_RATE) if by_gyro else _NO_BIAS
        _write_covariance(p.filter, x, memory.filter.covariances[k], by_gyro, memory.covariance)
        validity = VALIDITY_VALID if heading.mode == MODE_EARTH and heading.nis_dof > 0 else VALIDITY_HELD
        used = (USED_GYRO if by_gyro else 0) | (USED_SUN if heading.nis_dof > 0 else 0)
    solution = AttitudeSolution(
        sigma_bn,
        heading.omega_bn_b,
        bias_b,
        heading.age if validity != VALIDITY_NONE else 0.0,
        heading.nis,
        heading.nis_dof,
        heading.lit_mask,
        validity,
        used,
        heading.mode,
        cells.isolated,
    )
    return EarthlightState(after, cells, heading.omega_bn_b, heading.rate_source), solution
