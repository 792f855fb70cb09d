# SPDX-License-Identifier: Apache-2.0
"""Gain and normal of each cell as states of the Sun filter: calibration in flight.

Cell i has the gain gain_i (1 + g_i) and the normal n_i = unit(n0_i + a_i e1_i + b_i e2_i), e1 and e2 across the normal
of the mission. g, a and b are constants, known before the flight to `gain_sigma` and `tilt_sigma_deg`. Estimated, they
are corrected with all else; considered (Schmidt), they keep value and variance, and what they have in common with the
other states keeps the error bars true. While the Earth is unknown its light would be taken for gains: they are then
considered in any case, and for as long as a wrong turn about the Sun line, or the corrections to it, may mislead.
"""

from css_common.kernel import kernel
from css_common.vectors import Vec3, dot
from css_estimation.sun.cell_calibration import tilted_normal
from css_estimation.sun_filter.calibration_options import Calibration
from css_estimation.sun_filter.memory import DEAD, GAIN, HYPOTHESES, X_GAIN, SunFilterMemory, forget

PER_CELL = 3
"""States of each cell: gain and two tilts."""

# So long [s] after the turns about the Sun line have begun to be looked for, errors about it have not settled.
_SETTLED = 120.0
_LEAST_GAIN, _LARGEST_GAIN = -0.9, 2.0
_LARGEST_TILT = 0.5


@kernel
def first_state(cells: int) -> int:
    """Index of the first state of calibration."""
    return GAIN + 2 * cells


@kernel
def states_in_use(p: Calibration, cells: int, earth_known: bool) -> int:
    """How many of the states the filter works with; those of calibration come behind the Earth's."""
    if p.per_cell > 0:
        return GAIN + (2 + p.per_cell) * cells
    return GAIN + (2 * cells if earth_known else cells)


@kernel
def corrected_states(cells: int, states: int, learns: bool) -> int:
    """How many of the states in use are corrected; the others are considered."""
    return states if learns else min(states, first_state(cells))


@kernel
def calibrates_now(p: Calibration, since: float) -> bool:
    """Whether the states of calibration are corrected, `since` [s] of light with the Earth known."""
    return p.estimated and since > _SETTLED


@kernel
def begin_calibration(p: Calibration, cells: int, x, covariance) -> None:
    """As known before the flight."""
    if p.per_cell == 0:
        return
    for i in range(first_state(cells), covariance.shape[0]):
        x[i - GAIN + X_GAIN] = 0.0
    doubt_calibration(p, cells, covariance)


@kernel
def doubt_calibration(p: Calibration, cells: int, covariance) -> None:
    """As uncertain as before the flight, the values being the best there are."""
    if p.per_cell == 0:
        return
    for i in range(cells):
        at = first_state(cells) + PER_CELL * i
        forget(covariance, at, 1, p.gain)
        forget(covariance, at + 1, 2, p.tilt)


@kernel
def outlast_estimate(p: Calibration, cells: int, m: SunFilterMemory, trusted: bool) -> None:
    """Leaves to the next estimate what is known of the cells, when the present one is dropped.

    Args:
        trusted: it is dropped for another reason than that it is wrong; else cells are as known before the flight.
    """
    best = 0
    for k in range(HYPOTHESES):
        if m.weights[k] > m.weights[best]:
            best = k
    if not trusted:
        begin_calibration(p, cells, m.estimates[0], m.covariances[0])
    elif p.per_cell > 0 and best > 0:
        for i in range(first_state(cells), m.covariances.shape[1]):
            m.estimates[0, X_GAIN - GAIN + i] = m.estimates[best, X_GAIN - GAIN + i]
            for j in range(first_state(cells), m.covariances.shape[1]):
                m.covariances[0, i, j] = m.covariances[best, i, j]
    m.weights[0] = 0.0
    for other in range(1, HYPOTHESES):
        m.weights[other] = DEAD


@kernel
def calibrated(cells: int, i: int, x, normal_b: Vec3, sun_b: Vec3) -> tuple[float, Vec3, float, float]:
    """Of cell i: gain relative to the mission's, normal, and the derivatives of the Sun's cosine to its two tilts."""
    at = X_GAIN + 2 * cells + PER_CELL * i
    tilted_b, e1, e2 = tilted_normal(normal_b, x[at + 1], x[at + 2])
    return 1.0 + x[at], tilted_b, dot(e1, sun_b), dot(e2, sun_b)


@kernel
def correct_calibration(p: Calibration, cells: int, x, correction) -> None:
    """Adds corrections; gains and tilts stay within what a cell can have."""
    if p.per_cell == 0:
        return
    for i in range(cells):
        at = X_GAIN + 2 * cells + PER_CELL * i
        by = first_state(cells) + PER_CELL * i
        x[at] = min(max(x[at] + correction[by], _LEAST_GAIN), _LARGEST_GAIN)
        for k in range(1, PER_CELL):
            x[at + k] = min(max(x[at + k] + correction[by + k], -_LARGEST_TILT), _LARGEST_TILT)
