# SPDX-License-Identifier: Apache-2.0
"""Whether the attitude is the one that field and cells allow: confirmed, doubted, or moved to where it is.

An attitude is confirmed once all rolls about the field have been weighed (`roll_search`) and it lies where the weight
is. It is doubted when field or cells have refused to agree with it for too long; a false attitude agrees by the way, so
that agreement forgives only in part. The search then tells where the attitude is.
"""

import math

from css_common.attitude import mrp_subtract, mrp_to_rotation_vector
from css_common.kernel import kernel
from css_common.vectors import Vec3, dot, norm, scale
from css_estimation.attitude import roll_search, slow_errors
from css_estimation.attitude.attitude_options import AttitudeParameters
from css_estimation.attitude.attitude_solution import (
    AttitudeMemory,
    AttitudeState,
    with_alignment,
    with_attitude,
    with_search,
)
from css_estimation.attitude.attitude_update import Tally, believed_fields, telling_cells
from css_estimation.attitude.flight_references import References
from css_estimation.sun.error_covariance import ATTITUDE, BIAS, attitude_block, set_block
from css_estimation.symmetric import Symmetric, add_outer, inverse_form, isotropic, product, trace

# Of a contradiction as much is forgotten in a second of agreement. A false attitude agrees by the way, but seldom.
_FORGIVEN = 0.25
# After so long a contradiction all rolls are weighed anew [s].
_DOUBTED = 10.0
# Attitude of a search: its error across the field [rad], before the filter takes the field itself.
_LAID = 0.03
# Normalised squared angle, 99.9 % of chi-square of three, beyond which an attitude is not the one that was found.
_OTHER = 16.27


@kernel
def begun_at(
    p: AttitudeParameters,
    state: AttitudeState,
    memory: AttitudeMemory,
    sigma_bn: Vec3,
    covariance: Symmetric,
    anew: bool,
) -> AttitudeState:
    """State and memory with a new attitude; `anew`: what was learnt with the old one is wrong too."""
    set_block(memory.covariance, ATTITUDE, covariance)
    bias_b = state.bias_b
    if anew:
        bias_b = (0.0, 0.0, 0.0)
        set_block(memory.covariance, BIAS, isotropic(p.bias_variance))
        slow_errors.forget(p.slow, memory.covariance, memory.slow)
    return with_alignment(with_attitude(state, sigma_bn, bias_b), True, 0.0)


@kernel
def search_roll(
    p: AttitudeParameters,
    state: AttitudeState,
    memory: AttitudeMemory,
    dt: float,
    voltages,
    field_b: Vec3,
    references: References,
    light,
) -> tuple[AttitudeState, bool, int]:
    """State after another look at all rolls about the field, whether the attitude moved, and the cells that told."""
    believed_n, unbiased_b = believed_fields(memory, field_b, references)
    along_b = scale(1.0 / norm(unbiased_b), unbiased_b)
    attitude = attitude_block(memory.covariance)
    narrow, doubted = trace(attitude) < p.gated_below, state.contradicted > _DOUBTED
    search = state.search
    if not search.begun:
        known = state.aligned and not doubted
        variance = dot(along_b, product(attitude, along_b)) + roll_search.LEAST_VARIANCE if known else math.inf
        laid_bn = roll_search.laid_on(state.sigma_bn, believed_n, along_b)
        search = roll_search.begin(memory.weights, laid_bn, variance)
        if known and not narrow:
            # far off, a linear update by the field would take the axis that it leaves open for another one
            state = begun_at(p, state, memory, laid_bn, add_outer(isotropic(_LAID * _LAID), variance, along_b), False)
            return with_search(state, False, search), True, 0
    if not references.sunlit:
        return with_search(state, False, search), False, 0
    mask = telling_cells(p, memory, voltages, references)
    believed = References(references.sun_n, references.intensity, references.sunlit, believed_n)
    bright = slow_errors.brightness(memory.slow) if p.compensates_albedo else 0.0
    search = roll_search.weigh(
        p.cells,
        memory.calibration,
        search,
        memory.weights,
        dt,
        voltages,
        mask,
        unbiased_b,
        believed,
        light,
        bright,
        memory.albedo_work,
        memory.albedo,
    )
    verdict = roll_search.verdict(search, memory.weights, unbiased_b)
    if not verdict.found:
        return with_search(state, False, search), False, 0
    found = add_outer(isotropic(_LAID * _LAID), verdict.variance, along_b)
    off = inverse_form(found, mrp_to_rotation_vector(mrp_subtract(verdict.sigma_bn, state.sigma_bn)))
    moved = not (state.aligned and narrow) or doubted or off > _OTHER
    if moved:
        state = begun_at(p, state, memory, verdict.sigma_bn, found, state.aligned and narrow)
    return with_search(state, True, roll_search.no_search()), moved, mask


@kernel
def judged(state: AttitudeState, tally: Tally, dt: float) -> AttitudeState:
    """State with the time of contradiction after the measurements of a cycle."""
    contradicted = state.contradicted
    if tally.refused:
        contradicted += dt
    elif tally.taken > 0:
        contradicted = max(0.0, contradicted - _FORGIVEN * dt)
    state = with_alignment(state, True, contradicted)
    if state.confirmed and contradicted > _DOUBTED:
        return with_search(state, False, roll_search.no_search())
    return state
