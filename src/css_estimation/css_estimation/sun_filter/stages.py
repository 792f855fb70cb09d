# SPDX-License-Identifier: Apache-2.0
"""Which stage of the Sun filter comes after a cycle with an estimate: further, back to several turns, or lost."""

from css_common.kernel import kernel
from css_common.vectors import Vec3, multiply
from css_estimation.sun.sun_heading import Aiding
from css_estimation.sun_filter.cell_update import CellReading, bit_count, heading_sigma
from css_estimation.sun_filter.field_update import field_usable
from css_estimation.sun_filter.filter_state import (
    AFRESH,
    MODE_COASTING,
    MODE_CONVERGING,
    MODE_EARTH,
    MODE_NO_EARTH,
    MODE_ROLLS,
    STAGE_HEADING,
    STAGE_ROLL,
    Cycle,
    Progress,
)
from css_estimation.sun_filter.hypotheses import SETTLING, give_up_elsewhere, look_again, look_for_roll
from css_estimation.sun_filter.memory import SunFilterMemory, dcm_of
from css_estimation.sun_filter.options import SunFilterParameters
from css_estimation.sun_filter.sun_search import cost, least_cost

_SHORTEST_CONVERGENCE = 3.0  # [s]
_CONTRARY_TIME = 5.0  # [s]
_CONTRARY_SHARE = 0.4
# Another direction has to explain the outputs better by this much before the estimate is given up for it.
_BETTER = 6.0
_LOST = 1.0  # [rad] error of the heading beyond which there is no estimate
CONVERGED = 0.1  # [rad] error of the heading below which outputs can be told to fade


@kernel
def _lost(p: SunFilterParameters, contrary: float, sigma: float, x, sun_n: Vec3, flux: float, voltages) -> bool:
    """Whether an estimate has to be dropped."""
    if not sigma < _LOST:
        return True
    if contrary <= _CONTRARY_SHARE:
        return False
    here = cost(p, voltages, flux, multiply(dcm_of(x), sun_n))
    return here - least_cost(p, voltages, flux) > _BETTER


@kernel
def progress_after(
    p: SunFilterParameters,
    before: Progress,
    memory: SunFilterMemory,
    best: int,
    left: int,
    cycle: Cycle,
    use: bool,
    faded: float,
    reading: CellReading,
    ambiguous: bool,
    voltages,
    aiding: Aiding,
) -> tuple[Progress, int]:
    """Which stage comes next, and the mode of this cycle.

    Args:
        ambiguous: another Sun explains the outputs as well, and is followed beside this one.
    """
    stage, since, contrary = before.stage, before.since, before.contrary
    x, covariance = memory.estimates[best], memory.covariances[best]
    sun_n = aiding.sky.sun_n
    sigma = heading_sigma(covariance, sun_n)
    mode = MODE_COASTING
    if use:
        since += cycle.dt
        mode = MODE_EARTH if left == 1 else MODE_ROLLS
        if stage == STAGE_HEADING:
            mode = MODE_CONVERGING if aiding.sky.known or ambiguous or sigma > CONVERGED else MODE_NO_EARTH
        refused = bit_count(reading.refused)
        if refused + reading.nis_dof > 0:
            share = 1.0 if reading.contrary > 0 else refused / (refused + reading.nis_dof)
            contrary += (share - contrary) * min(1.0, cycle.dt / _CONTRARY_TIME)
    if left == 0 or _lost(p, contrary, sigma, x, sun_n, cycle.flux, voltages):
        return AFRESH, mode
    if contrary > _CONTRARY_SHARE:
        contrary = 0.0
    # the field tells the turn at once, whatever the Earth
    told = field_usable(p, aiding)
    enough = p.convergence.search_variance if told else p.convergence.roll_variance
    converged = (
        stage == STAGE_HEADING and (told or since > _SHORTEST_CONVERGENCE) and sigma * sigma < enough and not ambiguous
    )
    if use and aiding.sky.known and converged:
        look_for_roll(p, memory, sun_n)
        stage, since = STAGE_ROLL, 0.0
    elif stage == STAGE_ROLL and give_up_elsewhere(p, memory) and (left == 1 or since > SETTLING):
        look_again(p, memory, best, sun_n)
        since = 0.0
    return Progress(stage, True, since, contrary, faded), mode
