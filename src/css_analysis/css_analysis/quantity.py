# SPDX-License-Identifier: Apache-2.0
"""What a quantity that is measured of flights is, and what a study sums up to measure it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from css_analysis.flight_metrics import EstimatorMeasures


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
