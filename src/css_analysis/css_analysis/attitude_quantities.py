# SPDX-License-Identifier: Apache-2.0
"""The quantities of attitude filters."""

from css_analysis.flight_metrics import EstimatorMeasures
from css_analysis.quantity import Quantity
from css_analysis.sum_measures import bias_nees, error_p95, first_of, largest_error, mean_of

_NOT_SETTLED = "no attitude was estimated from measures.settled_time on"

ATTITUDE = (
    Quantity(
        "attitude_error_mean_deg",
        "deg",
        "of attitude filters: mean angle of the Euler rotation from estimated to true attitude, from "
        "measures.settled_time on",
        heading="attitude\nerror\nmean",
        form="{:.3f}",
        without_value=_NOT_SETTLED,
        measure=EstimatorMeasures.attitude_error_mean_deg,
        attitude_tally=mean_of("error_sum", "settled"),
    ),
    Quantity(
        "attitude_error_p95_deg",
        "deg",
        "of attitude filters: 95th percentile of the angle of estimated to true attitude from measures.settled_time on",
        heading="attitude\nerror\n95 %",
        form="{:.3f}",
        without_value=_NOT_SETTLED,
        measure=EstimatorMeasures.attitude_error_p95_deg,
        attitude_tally=error_p95,
    ),
    Quantity(
        "attitude_error_max_deg",
        "deg",
        "of attitude filters: largest angle of estimated to true attitude from measures.settled_time on",
        heading="attitude\nerror\nmax",
        attitude_tally=largest_error,
    ),
    Quantity(
        "gyro_bias_error_mean_deg_s",
        "deg/s",
        "of attitude filters: mean norm of the error of the estimated gyro bias from measures.settled_time on",
        heading="gyro\nbias\nerror",
        form="{:.4f}",
        attitude_tally=mean_of("bias_sum", "settled"),
    ),
    Quantity(
        "attitude_nees",
        "",
        "of attitude filters: mean normalised error squared of the attitude from measures.settled_time on, 3 if "
        "consistent",
        heading="attitude\nNEES\n(3)",
        without_value=_NOT_SETTLED,
        measure=EstimatorMeasures.attitude_nees,
        attitude_tally=mean_of("nees3_sum", "settled"),
    ),
    Quantity(
        "attitude_bias_nees",
        "",
        "of attitude filters: mean normalised error squared of attitude and gyro bias together, 6 if consistent",
        heading="with\nbias\n(6)",
        attitude_tally=bias_nees,
    ),
    Quantity(
        "attitude_nis",
        "",
        "of attitude filters: mean normalised innovation squared for each degree of freedom, 1 if consistent",
        heading="NIS\n(1)\n",
        form="{:.3f}",
        attitude_tally=mean_of("nis_sum", "innovations"),
    ),
    Quantity(
        "first_attitude_s",
        "s",
        "of attitude filters: time of the first attitude since the epoch",
        heading="first\natti-\ntude",
        form="{:.1f}",
        attitude_tally=first_of("first_step"),
    ),
)
