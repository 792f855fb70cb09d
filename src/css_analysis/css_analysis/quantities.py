# SPDX-License-Identifier: Apache-2.0
"""Every quantity that is measured of flights: the one table of names, units, headings, meanings and origins.

Figures of merit of a flight, columns of a study, pass criteria, JSON objects, terminal tables and the tables of the
README come from it.
"""

from css_analysis.attitude_quantities import ATTITUDE
from css_analysis.fault_quantities import FAULTS
from css_analysis.flight_metrics import Windows
from css_analysis.quantity import Quantity, Summary
from css_analysis.sun_quantities import (
    CONVERGING,
    DAWN,
    DETUMBLED,
    ECLIPSE,
    HEADING_MEAN,
    HEADING_P95,
    KEPT,
    LATE,
    POINTING,
    POWER_LATE,
    RATE_FINAL,
    REST,
    ROD_DIPOLE,
    reported,
)


def quantities(windows: Windows) -> tuple[Quantity, ...]:
    """All quantities in the order of tables, those of windows that a mission does not ask for left out."""
    return (
        *CONVERGING,
        *(_safe_mode(windows) if windows.detumbled_rate_deg_s > 0.0 else ()),
        HEADING_MEAN,
        HEADING_P95,
        ECLIPSE,
        DAWN,
        *((LATE,) if windows.late_time > 0.0 else ()),
        *ATTITUDE,
        *POINTING,
        RATE_FINAL,
        *(reported(windows.report_time) if windows.report_time > 0.0 else ()),
        *REST,
        *FAULTS,
    )


def _safe_mode(windows: Windows) -> tuple[Quantity, ...]:
    """What is measured from a tip-off to power."""
    return (DETUMBLED, KEPT, *((POWER_LATE,) if windows.late_time > 0.0 else ()), ROD_DIPOLE)


def flight_quantities(windows: Windows) -> dict[str, Quantity]:
    """What a flight is measured by, by name."""
    return {quantity.name: quantity for quantity in quantities(windows) if quantity.measure is not None}


_ALL_WINDOWS = Windows(late_time=1.0, detumbled_rate_deg_s=1.0)
QUANTITIES = flight_quantities(_ALL_WINDOWS)
"""What flights may be measured by, and criteria may ask for, by name."""


def needed_windows(quantity: str) -> tuple[str, ...]:
    """Keys of `measures` without which a quantity of `QUANTITIES` is not measured."""
    asked_for = [name for name, value in _ALL_WINDOWS._asdict().items() if value > 0.0]
    return tuple(n for n in asked_for if quantity not in flight_quantities(_ALL_WINDOWS._replace(**{n: 0.0})))


def study_quantities(windows: Windows) -> tuple[Quantity, ...]:
    """What a study measures of its cases, with the estimates of a Sun estimator."""
    return tuple(quantity for quantity in quantities(windows) if quantity.tally is not None)


def attitude_quantities(windows: Windows) -> tuple[Quantity, ...]:
    """What a study measures of its cases, with the estimates of an attitude filter."""
    return tuple(quantity for quantity in quantities(windows) if quantity.attitude_tally is not None)


def summaries(windows: Windows) -> tuple[Summary, ...]:
    """What is told of all cases of one configuration of a study."""
    at_report = reported(windows.report_time) if windows.report_time > 0.0 else ()
    return (
        _mean_over_cases(HEADING_MEAN),
        _mean_over_cases(HEADING_P95),
        _mean_over_cases(ECLIPSE),
        Summary("power_positive_fraction", "acquired_s", "share", "power\nposi-\ntive\n", "", "{:.1%}"),
        Summary("converging_mean_s", "converging_s", "mean", "con-\nverging\nmean", "s", "{:.1f}"),
        Summary("converging_max_s", "converging_s", "max", "con-\nverging\nmax", "s", "{:.1f}"),
        *(_safe_mode_summaries(windows) if windows.detumbled_rate_deg_s > 0.0 else ()),
        *map(_mean_over_cases, at_report),
    )


def _safe_mode_summaries(windows: Windows) -> tuple[Summary, ...]:
    detumbled, kept = DETUMBLED.name, KEPT.name
    late = POWER_LATE
    return (
        Summary("detumbled_mean_s", detumbled, "mean", "detum-\nbled\nmean", "s", "{:.0f}"),
        Summary("detumbled_p95_s", detumbled, "p95", "detum-\nbled\n95 %", "s", "{:.0f}"),
        Summary("detumbled_max_s", detumbled, "max", "detum-\nbled\nmax", "s", "{:.0f}"),
        Summary("power_positive_from_mean_s", kept, "mean", "power\nfrom\nmean", "s", "{:.0f}"),
        Summary("power_positive_from_p95_s", kept, "p95", "power\nfrom\n95 %", "s", "{:.0f}"),
        Summary("power_positive_from_max_s", kept, "max", "power\nfrom\nmax", "s", "{:.0f}"),
        *((_mean_over_cases(late),) if windows.late_time > 0.0 else ()),
        _mean_over_cases(ROD_DIPOLE),
    )


def attitude_summaries(windows: Windows) -> tuple[Summary, ...]:
    """What is told of all cases of one configuration with an attitude filter."""
    return tuple(map(_attitude_over_cases, attitude_quantities(windows)))


def _attitude_over_cases(quantity: Quantity) -> Summary:
    over = "max" if quantity.name == "attitude_error_max_deg" else "mean"
    form = "{:.1f}" if quantity.whole else quantity.form
    return Summary(quantity.name, quantity.study_column, over, quantity.heading, quantity.unit, form)


def _mean_over_cases(quantity: Quantity) -> Summary:
    return Summary(quantity.name, quantity.study_column, "mean", quantity.heading, quantity.unit, quantity.form)
