# SPDX-License-Identifier: Apache-2.0
"""A cycle of the Sun filter without an estimate: the Sun is looked for over the whole sphere."""

import math

from css_common.attitude import rotation_vector_to_dcm
from css_common.kernel import kernel
from css_common.matrices import IDENTITY
from css_common.vectors import matmul, multiply, norm, scale, unit
from css_estimation.sun.sun_heading import Aiding
from css_estimation.sun_filter.filter_state import (
    NO_RATE,
    STAGE_HEADING,
    STAGE_SEARCH,
    Cycle,
    Found,
    Progress,
    Rate,
    SunFilterState,
    filtered_rate,
)
from css_estimation.sun_filter.hypotheses import begin
from css_estimation.sun_filter.memory import DIRECTIONS, SunFilterMemory, dcm_of, set_dcm
from css_estimation.sun_filter.motion import RATE_BY_GYRO
from css_estimation.sun_filter.options import SunFilterParameters
from css_estimation.sun_filter.sun_search import MEMORY, look_of, search

_SHORTEST_SEARCH = 0.95  # [s]


@kernel
def search_cycle(
    p: SunFilterParameters, state: SunFilterState, memory: SunFilterMemory, cycle: Cycle, voltages, aiding: Aiding
) -> tuple[Progress, Rate, Found]:
    """A cycle without an estimate; the attitude of the first hypothesis is the frame in which directions are fixed."""
    before = state.progress
    x = memory.estimates[0]
    begun, since = before.begun, before.since
    raw_b = aiding.gyro_b if cycle.model == RATE_BY_GYRO else NO_RATE
    found = state.found
    if begun:
        turn = rotation_vector_to_dcm(scale(cycle.dt, raw_b))
        set_dcm(x, matmul(turn, dcm_of(x)))
        found = Found(unit(multiply(turn, found.sun_b)), found.variance)
    stage = STAGE_SEARCH
    if cycle.lit:
        if not begun:
            set_dcm(x, IDENTITY)
            for g in range(DIRECTIONS):
                memory.grid[g] = 0.0
            begun, since = True, 0.0
        since += cycle.dt
        # without a gyro the frame does not turn with the body, and what is old has to be forgotten
        turns = cycle.model == RATE_BY_GYRO
        kept = 1.0 if turns else math.exp(-cycle.dt / MEMORY)
        share = look_of(cycle.dt, since, norm(raw_b)) if turns else 1.0 - kept
        mean_n, variance = search(p, memory.grid, dcm_of(x), voltages, cycle.flux, kept, share)
        found = Found(multiply(dcm_of(x), mean_n), variance)
        if since > _SHORTEST_SEARCH and variance < p.convergence.search_variance:
            begin(p, memory, found.sun_b, variance, aiding.sky.sun_n, cycle.model, cycle.wheels_b)
            stage, since = STAGE_HEADING, 0.0
    return Progress(stage, begun, since, 0.0, 0.0), filtered_rate(p, state.rate, cycle, raw_b), found
