# SPDX-License-Identifier: Apache-2.0
"""A measured direction as up to three numbers with independent errors of one variance: what vector models give."""

from typing import NamedTuple

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3
from css_estimation.sun.error_covariance import Partials, attitude_block, begin_update, innovate, update
from css_estimation.symmetric import Symmetric, add_outer, congruence, inverse_form

_ZERO: Vec3 = (0.0, 0.0, 0.0)


class DirectionMeasurement(NamedTuple):
    """Rows of H for the attitude error and what remains of the measurement after the prediction."""

    rows: Mat3
    residual: Vec3
    variance: float
    dof: int  # rows that count, 0 to 3; those beyond are zeros


@kernel
def no_direction() -> DirectionMeasurement:
    """Nothing measured."""
    return DirectionMeasurement((_ZERO, _ZERO, _ZERO), _ZERO, 1.0, 0)


@kernel
def widened(m: DirectionMeasurement, variance: float, largest: float) -> DirectionMeasurement:
    """The measurement with a further error of `variance` in its direction, whose rows are weighted by `largest`."""
    return DirectionMeasurement(m.rows, m.residual, m.variance + variance * largest, m.dof)


@kernel
def normalised_innovation(covariance, m: DirectionMeasurement) -> float:
    """Normalised innovation squared of the whole direction, chi-square with `m.dof` degrees of freedom."""
    s: Symmetric = congruence(m.rows, attitude_block(covariance))
    for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)):
        s = add_outer(s, m.variance, axis)
    return inverse_form(s, m.residual)


@kernel
def update_direction(covariance, work, m: DirectionMeasurement, estimated: int) -> None:
    """Covariance and correction after a direction; errors from index `estimated` on are considered."""
    begin_update(work)
    for k in range(m.dof):
        h = Partials(m.rows[k], 0, 0, _ZERO)
        innovation, s = innovate(covariance, work, h, m.residual[k], m.variance)
        update(covariance, work, innovation, s, estimated)
