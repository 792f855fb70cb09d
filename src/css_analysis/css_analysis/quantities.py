# SPDX-License-Identifier: Apache-2.0
"""Every quantity that is measured of flights: the one table of names, units, headings, meanings and origins.

Figures of merit of a flight, columns of a study, pass criteria, JSON objects, terminal tables and the tables of the
README come from it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from css_analysis import fault_sums
from css_analysis.fault_sums import CELLS, RODS, SENSORS, WHEELS
from css_analysis.flight_metrics import EstimatorMeasures, Windows


class CaseSums(NamedTuple):
    """What a study summed up while C cases flew."""

    totals: np.ndarray  # (C,) with the fields of `TALLY` of `css_monte_carlo.case_tallies` or `attitude_tallies`
    histogram: np.ndarray  # (C, bins) heading errors after acquisition, or attitude errors once settled
    bin_deg: float
    period_s: float
    health: Any = None  # `HealthTallies` of `css_monte_carlo.health_tallies`; None of attitude filters


@dataclass(frozen=True)
class Quantity:
    """One quantity.

    Attributes:
        name: in figures of merit, criteria and JSON.
        unit: in which it is given, empty for numbers without one.
        heading: of a column in a terminal; empty: it has none there.
        form: how a terminal shows a value.
        description: what it is.
        without_value: why it may have no value although there are truth and estimates.
        measure: takes it from the log of a flight; None: only studies have it.
        tally: (C,) values from the sums over cases, NaN for what never came; None: studies lack it.
        attitude_tally: the same where an attitude filter is measured.
        column: its name in a study, if that is another.
        whole: it is a count.
    """

    name: str
    unit: str
    description: str
    heading: str = ""
    form: str = "{:.2f}"
    without_value: str = ""
    measure: Callable[[EstimatorMeasures], float | int | None] | None = None
    tally: Callable[[CaseSums], np.ndarray] | None = None
    attitude_tally: Callable[[CaseSums], np.ndarray] | None = None
    column: str = ""
    whole: bool = False

    @property
    def study_column(self) -> str:
        """Its name in the tables of a study."""
        return self.column or self.name

    @property
    def title(self) -> str:
        """Heading of its column in a terminal, with the unit."""
        return titled(self.heading, self.unit)


@dataclass(frozen=True)
class Summary:
    """A quantity over the cases of a study.

    Attributes:
        name: in JSON.
        of: column of the study's table of cases.
        over: `mean`, `p95` or `max` of the cases that have a value, or the `share` of cases that have one.
        heading, unit, form: as a `Quantity` has them.
    """

    name: str
    of: str
    over: str
    heading: str
    unit: str
    form: str = "{:.2f}"

    @property
    def title(self) -> str:
        """Heading of its column in a terminal, with the unit."""
        return titled(self.heading, self.unit)


def titled(heading: str, unit: str) -> str:
    """A heading with its unit on a line of its own."""
    return f"{heading}\n[{unit}]" if unit else heading


def percentile_of_histogram(counts: np.ndarray, percent: float, bin_deg: float) -> float:
    """Percentile [deg] of errors in bins of `bin_deg`, linear within a bin; NaN without any."""
    total = int(counts.sum())
    if total == 0:
        return float("nan")
    wanted = 0.01 * percent * total
    up_to = np.cumsum(counts)
    index = int(np.searchsorted(up_to, wanted))
    before = int(up_to[index - 1]) if index else 0
    return bin_deg * (index + (wanted - before) / int(counts[index]))


def _mean(total: str, count: str, each: int = 1) -> Callable[[CaseSums], np.ndarray]:
    """A sum over what it counts, of which every one stands for `each`."""
    return lambda sums: _ratio(sums.totals[total], each * sums.totals[count])


def _ratio(total: np.ndarray, count: np.ndarray) -> np.ndarray:
    return np.divide(total, count, out=np.full(len(count), np.nan), where=count > 0)


def _time(steps: str) -> Callable[[CaseSums], np.ndarray]:
    """Time [s] of so many steps."""
    return lambda sums: sums.totals[steps] * sums.period_s


def _converging(sums: CaseSums) -> np.ndarray:
    t = sums.totals
    return np.where(t["within"] > 0, (t["away_first"] + t["away_later"]) * sums.period_s, np.nan)


def _first(step: str) -> Callable[[CaseSums], np.ndarray]:
    """Time [s] of a step since the epoch, NaN for -1."""
    return lambda sums: np.where(sums.totals[step] >= 0, sums.totals[step] * sums.period_s, np.nan)


def _error_p95(sums: CaseSums) -> np.ndarray:
    return np.array([percentile_of_histogram(row, 95.0, sums.bin_deg) for row in sums.histogram])


def _largest_error(sums: CaseSums) -> np.ndarray:
    return np.where(sums.totals["settled"] > 0, sums.totals["error_max"], np.nan)


def _bias_nees(sums: CaseSums) -> np.ndarray:
    nees = _mean("nees6_sum", "settled")(sums)
    # a filter that estimates no bias has no covariance of it
    return np.where(np.isfinite(nees), nees, np.nan)


def _pointing_sunlit(sums: CaseSums) -> np.ndarray:
    t = sums.totals
    return _ratio(t["sunlit_pointing_sum"], t["away_first"] + t["away_later"] + t["within"])


_NOT_ACQUIRED = "the flight or its truth has no 60 s with the Sun within 30 deg of the array normal, or none after them"
_NOT_SETTLED = "no attitude was estimated from measures.settled_time on"

_HEADING_MEAN = Quantity(
    "heading_error_mean_deg",
    "deg",
    "mean angle of estimated to true Sun, sunlit, after acquisition; steps without an estimate do not enter",
    heading="heading\nerror\nmean",
    without_value=_NOT_ACQUIRED,
    measure=EstimatorMeasures.heading_error_mean_deg,
    tally=_mean("heading_sum", "headings"),
)
_HEADING_P95 = Quantity(
    "heading_error_p95_deg",
    "deg",
    "95th percentile of the angle of estimated to true Sun, sunlit, after acquisition",
    heading="heading\nerror\n95 %",
    without_value=_NOT_ACQUIRED,
    measure=EstimatorMeasures.heading_error_p95_deg,
    tally=_error_p95,
)
_CONVERGING = (
    Quantity(
        "power_positive_s",
        "s",
        "sunlit time with the Sun more than 30 deg off the array normal, the paper's time spent converging",
        heading="con-\nverging",
        form="{:.1f}",
        without_value=_NOT_ACQUIRED,
        measure=lambda m: m.flight.power_positive_s(),
        tally=_converging,
        column="converging_s",
    ),
    Quantity("converging_first_s", "s", "sunlit time converging before the first eclipse", tally=_time("away_first")),
    Quantity("converging_later_s", "s", "sunlit time converging after the first eclipse", tally=_time("away_later")),
    Quantity("acquired_s", "s", "time of the acquisition since the epoch", tally=_first("acquired_step")),
)
_DETUMBLED = Quantity(
    "detumbled_s",
    "s",
    "time since the epoch from which the body rate stays below measures.detumbled_rate_deg_s for 60 s",
    heading="detum-\nbled",
    form="{:.1f}",
    without_value="the body rate never stays below measures.detumbled_rate_deg_s for 60 s",
    measure=lambda m: m.flight.detumbled_s(),
    tally=_first("detumbled_step"),
)
_KEPT = Quantity(
    "power_positive_from_s",
    "s",
    "time since the epoch from which the Sun stays within 30 deg of the array normal in all sunlight that is left",
    heading="power\npositive\nfrom",
    form="{:.1f}",
    without_value="the last sunlit step has the Sun more than 30 deg off the array normal",
    measure=lambda m: m.flight.power_positive_from_s(),
    tally=_first("kept_step"),
)
_ROD_DIPOLE = Quantity(
    "rod_dipole_mean",
    "A m^2",
    "mean over the flight of the dipoles of all torque rods together, without their signs",
    heading="rods",
    form="{:.4f}",
    without_value="nobody commands torque rods",
    measure=lambda m: m.flight.rod_dipole_mean(),
    tally=_mean("dipole_sum", "steps"),
)
_POWER_LATE = Quantity(
    "power_positive_late",
    "",
    "share of the last measures.late_time of sunlight with the Sun within 30 deg of the array normal",
    heading="power\npositive\nlate",
    form="{:.3f}",
    without_value="the flight or its truth has no sunlight, or measures.late_time is 0",
    measure=lambda m: m.flight.power_positive_late(),
    tally=_mean("late_within", "late_lit"),
)
_NO_ECLIPSE = "there was no eclipse, or no estimate in it and after it"
_ECLIPSE = Quantity(
    "heading_error_eclipse_deg",
    "deg",
    "mean angle of estimated to true Sun in eclipse",
    heading="error\nin\neclipse",
    without_value=_NO_ECLIPSE,
    measure=EstimatorMeasures.heading_error_eclipse_deg,
    tally=_mean("dark_sum", "dark"),
)
_DAWN = Quantity(
    "heading_error_dawn_deg",
    "deg",
    "mean angle of estimated to true Sun in the first 60 s of sunlight after an eclipse",
    without_value=_NO_ECLIPSE,
    measure=EstimatorMeasures.heading_error_dawn_deg,
    tally=_mean("dawn_sum", "dawn"),
)
_LATE = Quantity(
    "heading_error_late_deg",
    "deg",
    "mean angle of estimated to true Sun over the last measures.late_time of sunlight",
    tally=_mean("late_sum", "late"),
)
_ATTITUDE = (
    Quantity(
        "attitude_error_mean_deg",
        "deg",
        "of attitude filters: mean angle of the Euler rotation from estimated to true attitude, from "
        "measures.settled_time on",
        heading="attitude\nerror\nmean",
        form="{:.3f}",
        without_value=_NOT_SETTLED,
        measure=EstimatorMeasures.attitude_error_mean_deg,
        attitude_tally=_mean("error_sum", "settled"),
    ),
    Quantity(
        "attitude_error_p95_deg",
        "deg",
        "of attitude filters: 95th percentile of the angle of estimated to true attitude from measures.settled_time on",
        heading="attitude\nerror\n95 %",
        form="{:.3f}",
        without_value=_NOT_SETTLED,
        measure=EstimatorMeasures.attitude_error_p95_deg,
        attitude_tally=_error_p95,
    ),
    Quantity(
        "attitude_error_max_deg",
        "deg",
        "of attitude filters: largest angle of estimated to true attitude from measures.settled_time on",
        heading="attitude\nerror\nmax",
        attitude_tally=_largest_error,
    ),
    Quantity(
        "gyro_bias_error_mean_deg_s",
        "deg/s",
        "of attitude filters: mean norm of the error of the estimated gyro bias from measures.settled_time on",
        heading="gyro\nbias\nerror",
        form="{:.4f}",
        attitude_tally=_mean("bias_sum", "settled"),
    ),
    Quantity(
        "attitude_nees",
        "",
        "of attitude filters: mean normalised error squared of the attitude from measures.settled_time on, 3 if "
        "consistent",
        heading="attitude\nNEES\n(3)",
        without_value=_NOT_SETTLED,
        measure=EstimatorMeasures.attitude_nees,
        attitude_tally=_mean("nees3_sum", "settled"),
    ),
    Quantity(
        "attitude_bias_nees",
        "",
        "of attitude filters: mean normalised error squared of attitude and gyro bias together, 6 if consistent",
        heading="with\nbias\n(6)",
        attitude_tally=_bias_nees,
    ),
    Quantity(
        "attitude_nis",
        "",
        "of attitude filters: mean normalised innovation squared for each degree of freedom, 1 if consistent",
        heading="NIS\n(1)\n",
        form="{:.3f}",
        attitude_tally=_mean("nis_sum", "innovations"),
    ),
    Quantity(
        "first_attitude_s",
        "s",
        "of attitude filters: time of the first attitude since the epoch",
        heading="first\natti-\ntude",
        form="{:.1f}",
        attitude_tally=_first("first_step"),
    ),
)
_POINTING = (
    Quantity(
        "pointing_error_mean_deg",
        "deg",
        "mean angle of array normal to true Sun, sunlit, after acquisition",
        heading="pointing\nerror\nmean",
        without_value=_NOT_ACQUIRED,
        measure=lambda m: m.flight.pointing_error_mean_deg(),
        tally=_mean("pointing_sum", "pointings"),
    ),
    Quantity(
        "pointing_error_sunlit_deg",
        "deg",
        "mean angle of array normal to true Sun over all sunlit steps, those before acquisition included",
        measure=lambda m: m.flight.pointing_error_sunlit_deg(),
        tally=_pointing_sunlit,
    ),
    Quantity(
        "heading_error_sunlit_deg",
        "deg",
        "mean angle of estimated to true Sun over all sunlit steps with an estimate",
        measure=EstimatorMeasures.heading_error_sunlit_deg,
        tally=_mean("sunlit_heading_sum", "sunlit_headings"),
    ),
)
_RATE_FINAL = Quantity(
    "rate_final_deg_s",
    "deg/s",
    "mean norm of the true body rate over the last 60 s",
    heading="final\nrate",
    form="{:.3f}",
    measure=lambda m: m.flight.rate_final_deg_s(),
    tally=_mean("final_sum", "final"),
)
_REST = (
    Quantity("wheel_momentum_max", "N m s", "largest momentum of all wheels", tally=lambda s: s.totals["momentum_max"]),
    Quantity(
        "wheel_momentum_final", "N m s", "momentum of all wheels at the end", tally=lambda s: s.totals["momentum"]
    ),
    Quantity(
        "nees_mean",
        "",
        "normalised error squared across the Sun line over the two axes, 1 if consistent: mean over the samples of the "
        "whole flight that have an error bar, before acquisition and in the dark too",
        tally=_mean("nees_sum", "consistencies", each=2),
    ),
    Quantity(
        "nis_mean",
        "",
        "normalised innovation squared over its degrees of freedom, 1 if consistent: mean over all steps with one",
        tally=_mean("nis_sum", "innovations"),
    ),
    Quantity(
        "steps_without_estimate",
        "",
        "sunlit steps of the flight at which the estimator had none",
        heading="steps\nwithout\nestimate",
        form="{:d}",
        measure=EstimatorMeasures.steps_without_estimate,
        tally=lambda sums: sums.totals["without_estimate"],
        attitude_tally=lambda sums: sums.totals["without_estimate"],
        whole=True,
    ),
)


def _isolated(name: str, description: str, *sorts: int) -> Quantity:
    return _counted(name, description, lambda sums: fault_sums.isolated_units(sums.health, *sorts))


def _wrong(name: str, description: str, *sorts: int) -> Quantity:
    return _counted(name, description, lambda sums: fault_sums.false_isolations(sums.health, *sorts))


def _counted(name: str, description: str, count: Callable[[CaseSums], np.ndarray]) -> Quantity:
    return Quantity(name, "", description, tally=count, whole=True)


_FAULTS = (
    Quantity(
        "fault_shown_s",
        "s",
        "time since the epoch at which the first fault shows: that of a cell when its reading is off by more than "
        "5 sigma of its noise, losses, calibration and 0.4 of the light of the Earth on it; that of other units when "
        "it begins",
        tally=lambda sums: fault_sums.shown_s(sums.health, sums.period_s),
    ),
    Quantity(
        "detected_s",
        "s",
        "longest time from a fault that shows to the isolation of its unit; null while one of them is not isolated",
        tally=lambda sums: fault_sums.detected_s(sums.health, sums.period_s),
    ),
    Quantity(
        "undetected_units",
        "",
        "units whose fault showed and that were not isolated while it acted",
        tally=lambda sums: fault_sums.undetected_units(sums.health),
        whole=True,
    ),
    _counted(
        "misnamed_units",
        "failed cells that were isolated and last taken for what they are not; kinds that no reading tells apart are "
        "one",
        lambda sums: fault_sums.misnamed_units(sums.health),
    ),
    _isolated("isolated_cells", "different cells that were ever isolated", CELLS),
    _isolated("isolated_actuators", "different wheels and torque rods that were ever isolated", WHEELS, RODS),
    _isolated(
        "left_sensors",
        "gyro and magnetometer: of how many of them axes were ever held for failed, whether they were left out or "
        "corrected",
        SENSORS,
    ),
    _wrong("false_isolations", "isolations of a cell that began while no fault acted on it", CELLS),
    _wrong(
        "false_actuator_isolations",
        "isolations of a wheel or torque rod that began while no fault acted on it",
        WHEELS,
        RODS,
    ),
    _wrong(
        "falsely_left_sensors",
        "gyro and magnetometer: how often an axis was held for failed while no fault acted on it",
        SENSORS,
    ),
)


def quantities(windows: Windows) -> tuple[Quantity, ...]:
    """All quantities in the order of tables, those of windows that a mission does not ask for left out."""
    return (
        *_CONVERGING,
        *(_safe_mode(windows) if windows.detumbled_rate_deg_s > 0.0 else ()),
        _HEADING_MEAN,
        _HEADING_P95,
        _ECLIPSE,
        _DAWN,
        *((_LATE,) if windows.late_time > 0.0 else ()),
        *_ATTITUDE,
        *_POINTING,
        _RATE_FINAL,
        *(_reported(windows.report_time) if windows.report_time > 0.0 else ()),
        *_REST,
        *_FAULTS,
    )


def _safe_mode(windows: Windows) -> tuple[Quantity, ...]:
    """What is measured from a tip-off to power."""
    return (_DETUMBLED, _KEPT, *((_POWER_LATE,) if windows.late_time > 0.0 else ()), _ROD_DIPOLE)


def _reported(time: float) -> tuple[Quantity, Quantity]:
    """The rates at a time [s] from the epoch, which is part of their names."""
    minutes = f"{time / 60.0:g}"
    return (
        Quantity(
            f"rate_{minutes}min_deg_s",
            "deg/s",
            f"mean norm of the true body rate over the minute before {minutes} min from the epoch",
            heading=f"rate at\n{minutes} min\n",
            form="{:.3f}",
            tally=_mean("reported_sum", "reported"),
        ),
        Quantity(
            f"rate_knowledge_{minutes}min_deg_s",
            "deg/s",
            f"mean norm of the error of the estimated body rate over the minute before {minutes} min from the epoch",
            heading="its\nerror\n",
            form="{:.3f}",
            tally=_mean("reported_knowledge_sum", "reported"),
        ),
    )


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
    reported = _reported(windows.report_time) if windows.report_time > 0.0 else ()
    return (
        _mean_over_cases(_HEADING_MEAN),
        _mean_over_cases(_HEADING_P95),
        _mean_over_cases(_ECLIPSE),
        Summary("power_positive_fraction", "acquired_s", "share", "power\nposi-\ntive\n", "", "{:.1%}"),
        Summary("converging_mean_s", "converging_s", "mean", "con-\nverging\nmean", "s", "{:.1f}"),
        Summary("converging_max_s", "converging_s", "max", "con-\nverging\nmax", "s", "{:.1f}"),
        *(_safe_mode_summaries(windows) if windows.detumbled_rate_deg_s > 0.0 else ()),
        *map(_mean_over_cases, reported),
    )


def _safe_mode_summaries(windows: Windows) -> tuple[Summary, ...]:
    detumbled, kept = _DETUMBLED.name, _KEPT.name
    late = _POWER_LATE
    return (
        Summary("detumbled_mean_s", detumbled, "mean", "detum-\nbled\nmean", "s", "{:.0f}"),
        Summary("detumbled_p95_s", detumbled, "p95", "detum-\nbled\n95 %", "s", "{:.0f}"),
        Summary("detumbled_max_s", detumbled, "max", "detum-\nbled\nmax", "s", "{:.0f}"),
        Summary("power_positive_from_mean_s", kept, "mean", "power\nfrom\nmean", "s", "{:.0f}"),
        Summary("power_positive_from_p95_s", kept, "p95", "power\nfrom\n95 %", "s", "{:.0f}"),
        Summary("power_positive_from_max_s", kept, "max", "power\nfrom\nmax", "s", "{:.0f}"),
        *((_mean_over_cases(late),) if windows.late_time > 0.0 else ()),
        _mean_over_cases(_ROD_DIPOLE),
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
