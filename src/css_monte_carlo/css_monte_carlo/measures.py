# SPDX-License-Identifier: Apache-2.0
"""How estimates of each kind are measured in a study: running sums while flying, and the columns that they give."""

from collections.abc import Callable
from typing import NamedTuple

from css_analysis.flight_metrics import Windows
from css_analysis.quantities import attitude_quantities, attitude_summaries, study_quantities, summaries
from css_analysis.quantity import Quantity, Summary
from css_monte_carlo import attitude_tallies, case_tallies
from css_monte_carlo.attitude_tallies import AttitudeTallies
from css_monte_carlo.case_tallies import Tallies

CaseTallies = Tallies | AttitudeTallies


class Measure(NamedTuple):
    """Of one kind of estimator."""

    tallies: type
    new_tallies: Callable[[int, int, float, int, Windows], CaseTallies]  # cases, steps, period [s], steps to a sample
    sampled: tuple[str, ...]  # quantities against time
    quantities: Callable[[Windows], tuple[Quantity, ...]]  # columns of a case
    summaries: Callable[[Windows], tuple[Summary, ...]]  # what is told of all cases
    estimate_columns: int  # of a trace


def _new_headings(cases: int, steps: int, period_s: float, sample_every: int, windows: Windows) -> CaseTallies:
    return case_tallies.new_tallies(cases, steps, period_s, sample_every, windows.detumbled_rate_deg_s)


def _new_attitudes(cases: int, steps: int, period_s: float, sample_every: int, windows: Windows) -> CaseTallies:
    return attitude_tallies.new_tallies(cases, steps, period_s, sample_every, windows.settled_time)


HEADING = Measure(
    Tallies, _new_headings, case_tallies.SAMPLED, study_quantities, summaries, case_tallies.ESTIMATE_COLUMNS
)
"""Of a Sun estimator."""

ATTITUDE = Measure(
    AttitudeTallies,
    _new_attitudes,
    attitude_tallies.SAMPLED,
    attitude_quantities,
    attitude_summaries,
    attitude_tallies.ESTIMATE_COLUMNS,
)
"""Of an attitude filter."""
