# SPDX-License-Identifier: Apache-2.0
"""The quantities of Sun estimators, of the motion and of the power that comes of them."""

from css_analysis.flight_metrics import EstimatorMeasures
from css_analysis.quantity import Quantity
from css_analysis.sum_measures import converging, error_p95, first_of, mean_of, pointing_sunlit, time_of

_NOT_ACQUIRED = "the flight or its truth has no 60 s with the Sun within 30 deg of the array normal, or none after them"

HEADING_MEAN = Quantity(
    "heading_error_mean_deg",
    "deg",
    "mean angle of estimated to true Sun, sunlit, after acquisition; steps without an estimate do not enter",
    heading="heading\nerror\nmean",
    without_value=_NOT_ACQUIRED,
    measure=EstimatorMeasures.heading_error_mean_deg,
    tally=mean_of("heading_sum", "headings"),
)

HEADING_P95 = Quantity(
    "heading_error_p95_deg",
    "deg",
    "95th percentile of the angle of estimated to true Sun, sunlit, after acquisition",
    heading="heading\nerror\n95 %",
    without_value=_NOT_ACQUIRED,
    measure=EstimatorMeasures.heading_error_p95_deg,
    tally=error_p95,
)

CONVERGING = (
    Quantity(
        "power_positive_s",
        "s",
        "sunlit time with the Sun more than 30 deg off the array normal, the paper's time spent converging",
        heading="con-\nverging",
        form="{:.1f}",
        without_value=_NOT_ACQUIRED,
        measure=lambda m: m.flight.power_positive_s(),
        tally=converging,
        column="converging_s",
    ),
    Quantity("converging_first_s", "s", "sunlit time converging before the first eclipse", tally=time_of("away_first")),
    Quantity("converging_later_s", "s", "sunlit time converging after the first eclipse", tally=time_of("away_later")),
    Quantity("acquired_s", "s", "time of the acquisition since the epoch", tally=first_of("acquired_step")),
)

DETUMBLED = Quantity(
    "detumbled_s",
    "s",
    "time since the epoch from which the body rate stays below measures.detumbled_rate_deg_s for 60 s",
    heading="detum-\nbled",
    form="{:.1f}",
    without_value="the body rate never stays below measures.detumbled_rate_deg_s for 60 s",
    measure=lambda m: m.flight.detumbled_s(),
    tally=first_of("detumbled_step"),
)

KEPT = Quantity(
    "power_positive_from_s",
    "s",
    "time since the epoch from which the Sun stays within 30 deg of the array normal in all sunlight that is left",
    heading="power\npositive\nfrom",
    form="{:.1f}",
    without_value="the last sunlit step has the Sun more than 30 deg off the array normal",
    measure=lambda m: m.flight.power_positive_from_s(),
    tally=first_of("kept_step"),
)

ROD_DIPOLE = Quantity(
    "rod_dipole_mean",
    "A m^2",
    "mean over the flight of the dipoles of all torque rods together, without their signs",
    heading="rods",
    form="{:.4f}",
    without_value="nobody commands torque rods",
    measure=lambda m: m.flight.rod_dipole_mean(),
    tally=mean_of("dipole_sum", "steps"),
)

POWER_LATE = Quantity(
    "power_positive_late",
    "",
    "share of the last measures.late_time of sunlight with the Sun within 30 deg of the array normal",
    heading="power\npositive\nlate",
    form="{:.3f}",
    without_value="the flight or its truth has no sunlight, or measures.late_time is 0",
    measure=lambda m: m.flight.power_positive_late(),
    tally=mean_of("late_within", "late_lit"),
)
_NO_ECLIPSE = "there was no eclipse, or no estimate in it and after it"

ECLIPSE = Quantity(
    "heading_error_eclipse_deg",
    "deg",
    "mean angle of estimated to true Sun in eclipse",
    heading="error\nin\neclipse",
    without_value=_NO_ECLIPSE,
    measure=EstimatorMeasures.heading_error_eclipse_deg,
    tally=mean_of("dark_sum", "dark"),
)

DAWN = Quantity(
    "heading_error_dawn_deg",
    "deg",
    "mean angle of estimated to true Sun in the first 60 s of sunlight after an eclipse",
    without_value=_NO_ECLIPSE,
    measure=EstimatorMeasures.heading_error_dawn_deg,
    tally=mean_of("dawn_sum", "dawn"),
)

LATE = Quantity(
    "heading_error_late_deg",
    "deg",
    "mean angle of estimated to true Sun over the last measures.late_time of sunlight",
    tally=mean_of("late_sum", "late"),
)

POINTING = (
    Quantity(
        "pointing_error_mean_deg",
        "deg",
        "mean angle of array normal to true Sun, sunlit, after acquisition",
        heading="pointing\nerror\nmean",
        without_value=_NOT_ACQUIRED,
        measure=lambda m: m.flight.pointing_error_mean_deg(),
        tally=mean_of("pointing_sum", "pointings"),
    ),
    Quantity(
        "pointing_error_sunlit_deg",
        "deg",
        "mean angle of array normal to true Sun over all sunlit steps, those before acquisition included",
        measure=lambda m: m.flight.pointing_error_sunlit_deg(),
        tally=pointing_sunlit,
    ),
    Quantity(
        "heading_error_sunlit_deg",
        "deg",
        "mean angle of estimated to true Sun over all sunlit steps with an estimate",
        measure=EstimatorMeasures.heading_error_sunlit_deg,
        tally=mean_of("sunlit_heading_sum", "sunlit_headings"),
    ),
)

RATE_FINAL = Quantity(
    "rate_final_deg_s",
    "deg/s",
    "mean norm of the true body rate over the last 60 s",
    heading="final\nrate",
    form="{:.3f}",
    measure=lambda m: m.flight.rate_final_deg_s(),
    tally=mean_of("final_sum", "final"),
)

REST = (
    Quantity("wheel_momentum_max", "N m s", "largest momentum of all wheels", tally=lambda s: s.totals["momentum_max"]),
    Quantity(
        "wheel_momentum_final", "N m s", "momentum of all wheels at the end", tally=lambda s: s.totals["momentum"]
    ),
    Quantity(
        "nees_mean",
        "",
        "normalised error squared across the Sun line over the two axes, 1 if consistent: mean over the samples of the "
        "whole flight that have an error bar, before acquisition and in the dark too",
        tally=mean_of("nees_sum", "consistencies", each=2),
    ),
    Quantity(
        "nis_mean",
        "",
        "normalised innovation squared over its degrees of freedom, 1 if consistent: mean over all steps with one",
        tally=mean_of("nis_sum", "innovations"),
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


def reported(time: float) -> tuple[Quantity, Quantity]:
    """The rates at a time [s] from the epoch, which is part of their names."""
    minutes = f"{time / 60.0:g}"
    return (
        Quantity(
            f"rate_{minutes}min_deg_s",
            "deg/s",
            f"mean norm of the true body rate over the minute before {minutes} min from the epoch",
            heading=f"rate at\n{minutes} min\n",
            form="{:.3f}",
            tally=mean_of("reported_sum", "reported"),
        ),
        Quantity(
            f"rate_knowledge_{minutes}min_deg_s",
            "deg/s",
            f"mean norm of the error of the estimated body rate over the minute before {minutes} min from the epoch",
            heading="its\nerror\n",
            form="{:.3f}",
            tally=mean_of("reported_knowledge_sum", "reported"),
        ),
    )
