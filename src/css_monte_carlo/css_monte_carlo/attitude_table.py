# SPDX-License-Identifier: Apache-2.0
"""Figures of merit of each case with an attitude filter as columns, from the tallies that the loop kept."""

import numpy as np
import pyarrow as pa

from css_monte_carlo.attitude_tallies import SAMPLED, AttitudeTallies
from css_monte_carlo.case_table import percentile_of_histogram, ratio, table_of

FIGURES = (
    "first_attitude_s",
    "attitude_error_mean_deg",
    "attitude_error_p95_deg",
    "attitude_error_max_deg",
    "gyro_bias_error_mean_deg_s",
    "attitude_nees",
    "attitude_bias_nees",
    "attitude_nis",
)
"""Columns of a case in the order of the table; what never came is null.

All but the first are over the steps from 300 s on, as `css_analysis.flight_metrics` counts. A consistent filter has a
NEES of 3 (attitude) and of 6 (attitude and bias together), and a NIS of 1 for each degree of freedom.
"""


def attitude_table(numbers: np.ndarray, tallies: AttitudeTallies, period_s: float) -> pa.Table:
    """One row a case: `FIGURES`, sunlit steps without an estimate, and the samples of each quantity as a list."""
    t = tallies.totals
    figures = {
        "first_attitude_s": np.where(t["first_step"] >= 0, t["first_step"] * period_s, np.nan),
        "attitude_error_mean_deg": ratio(t["error_sum"], t["settled"]),
        "attitude_error_p95_deg": np.array([percentile_of_histogram(row, 95.0) for row in tallies.histogram]),
        "attitude_error_max_deg": np.where(t["settled"] > 0, t["error_max"], np.nan),
        "gyro_bias_error_mean_deg_s": ratio(t["bias_sum"], t["settled"]),
        "attitude_nees": ratio(t["nees3_sum"], t["settled"]),
        "attitude_bias_nees": _finite(ratio(t["nees6_sum"], t["settled"])),
        "attitude_nis": ratio(t["nis_sum"], t["innovations"]),
    }
    return table_of(numbers, figures, t["without_estimate"], SAMPLED, tallies.samples)


def _finite(values: np.ndarray) -> np.ndarray:
    # a filter that estimates no bias has no covariance of it
    return np.where(np.isfinite(values), values, np.nan)
