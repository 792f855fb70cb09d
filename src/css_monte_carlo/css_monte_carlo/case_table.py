# SPDX-License-Identifier: Apache-2.0
"""Figures of merit of each case with a Sun estimator as columns, from the tallies that the loop kept."""

import numpy as np
import pyarrow as pa

from css_monte_carlo.case_tallies import BIN_DEG, SAMPLED, Tallies

FIGURES = (
    "converging_s",
    "converging_first_s",
    "converging_later_s",
    "acquired_s",
    "heading_error_mean_deg",
    "heading_error_p95_deg",
    "heading_error_late_deg",
    "pointing_error_mean_deg",
    "pointing_error_sunlit_deg",
    "heading_error_sunlit_deg",
    "rate_final_deg_s",
    "rate_50min_deg_s",
    "rate_knowledge_50min_deg_s",
    "wheel_momentum_max",
    "wheel_momentum_final",
    "nees_mean",
    "nis_mean",
)
"""Columns of a case in the order of the table; what never came is null. Momentum in N m s.

converging_s is the sunlit time with the Sun over 30 deg off the array normal, null if it never came within; first and
later are its parts before and after the first eclipse. NEES (two axes across the Sun line) and NIS are per degree of
freedom, so that one is consistent.
"""


def case_table(numbers: np.ndarray, tallies: Tallies, period_s: float) -> pa.Table:
    """One row a case: `FIGURES`, steps without an estimate, and the samples of each quantity as a list."""
    t = tallies.totals
    away = (t["away_first"] + t["away_later"]) * period_s
    figures = {
        "converging_s": np.where(t["within"] > 0, away, np.nan),
        "converging_first_s": t["away_first"] * period_s,
        "converging_later_s": t["away_later"] * period_s,
        "acquired_s": np.where(t["acquired_step"] >= 0, t["acquired_step"] * period_s, np.nan),
        "heading_error_mean_deg": ratio(t["heading_sum"], t["headings"]),
        "heading_error_p95_deg": np.array([percentile_of_histogram(row, 95.0) for row in tallies.histogram]),
        "heading_error_late_deg": ratio(t["late_sum"], t["late"]),
        "pointing_error_mean_deg": ratio(t["pointing_sum"], t["pointings"]),
        "pointing_error_sunlit_deg": ratio(t["sunlit_pointing_sum"], t["away_first"] + t["away_later"] + t["within"]),
        "heading_error_sunlit_deg": ratio(t["sunlit_heading_sum"], t["sunlit_headings"]),
        "rate_final_deg_s": ratio(t["final_sum"], t["final"]),
        "rate_50min_deg_s": ratio(t["reported_sum"], t["reported"]),
        "rate_knowledge_50min_deg_s": ratio(t["reported_knowledge_sum"], t["reported"]),
        "wheel_momentum_max": t["momentum_max"],
        "wheel_momentum_final": t["momentum"],
        "nees_mean": ratio(t["nees_sum"], 2 * t["consistencies"]),
        "nis_mean": ratio(t["nis_sum"], t["innovations"]),
    }
    return table_of(numbers, figures, t["without_estimate"], SAMPLED, tallies.samples)


def table_of(
    numbers: np.ndarray,
    figures: dict[str, np.ndarray],
    without_estimate: np.ndarray,
    sampled: tuple[str, ...],
    samples: np.ndarray,
) -> pa.Table:
    """Columns of C cases: figures (C,), NaN as null, steps without an estimate, samples (C, quantities, S) as lists."""
    columns = {"case": pa.array(numbers, pa.uint32())}
    columns |= {name: pa.array(values, pa.float64(), from_pandas=True) for name, values in figures.items()}
    columns["steps_without_estimate"] = pa.array(without_estimate, pa.int64())
    for i, quantity in enumerate(sampled):
        columns[quantity] = pa.array(list(samples[:, i]), pa.list_(pa.float32()))
    return pa.table(columns)


def percentile_of_histogram(counts: np.ndarray, percent: float) -> float:
    """Percentile [deg] of errors in bins of `BIN_DEG`, linear within a bin; NaN without any."""
    total = int(counts.sum())
    if total == 0:
        return float("nan")
    wanted = 0.01 * percent * total
    up_to = np.cumsum(counts)
    index = int(np.searchsorted(up_to, wanted))
    before = int(up_to[index - 1]) if index else 0
    return BIN_DEG * (index + (wanted - before) / int(counts[index]))


def ratio(total: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Means (C,) of sums; NaN where nothing was counted."""
    return np.divide(total, count, out=np.full(len(count), np.nan), where=count > 0)
