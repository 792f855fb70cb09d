# SPDX-License-Identifier: Apache-2.0
"""A measured direction as up to three numbers with independent errors of one variance: what vector models give."""

from typing import NamedTuple

from css_common.kernel import kernel
from css_common.vectors import Vec3
from css_estimation.sun.error_covariance import (
    Partials,
    attitude_partials,
    begin_update,
    covariance_of,
    innovate,
    update,
)
from css_estimation.symmetric import inverse_form

_ZERO: Vec3 = (0.0, 0.0, 0.0)


class DirectionMeasurement(NamedTuple):
    """Derivatives of the numbers and what remains of the measurement after the prediction."""

    rows: tuple[Partials, Partials, Partials]
    residual: Vec3
    variance: float
    dof: int  # rows that count, 0 to 3; those beyond are zeros


@kernel
def attitude_rows(first: Vec3, second: Vec3, third: Vec3) -> tuple[Partials, Partials, Partials]:
    """Rows of H for the attitude error alone."""
    return (attitude_partials(first), attitude_partials(second), attitude_partials(third))


@kernel
def no_direction() -> DirectionMeasurement:
    """Nothing measured."""
    return DirectionMeasurement(attitude_rows(_ZERO, _ZERO, _ZERO), _ZERO, 1.0, 0)


@kernel
def widened(m: DirectionMeasurement, variance: float, largest: float) -> DirectionMeasurement:
    """The measurement with a further error of `variance` in its direction, whose rows are weighted by `largest`."""
    return DirectionMeasurement(m.rows, m.residual, m.variance + variance * largest, m.dof)


@kernel
def normalised_innovation(covariance, m: DirectionMeasurement) -> float:
    """Normalised innovation squared of the whole direction, chi-square with `m.dof` degrees of freedom."""
    a, b, c = m.rows
    return inverse_form(
        (
            covariance_of(covariance, a, a) + m.variance,
            covariance_of(covariance, a, b),
            covariance_of(covariance, a, c),
            covariance_of(covariance, b, b) + m.variance,
            covariance_of(covariance, b, c),
            covariance_of(covariance, c, c) + m.variance,
        ),
        m.residual,
    )


@kernel
def update_direction(covariance, work, m: DirectionMeasurement, estimated: int) -> None:
    """Covariance and correction after a direction; errors from index `estimated` on are considered."""
    begin_update(work)
    # all three, as a compiled index into a tuple has a way out by an exception unless its bound is a constant
    for k in range(3):
        if k < m.dof:
            innovation, s = innovate(covariance, work, m.rows[k], m.residual[k], m.variance)
            update(covariance, work, innovation, s, estimated)
