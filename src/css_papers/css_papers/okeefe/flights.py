# SPDX-License-Identifier: Apache-2.0
"""Figures of merit of one configuration out of the tables of a study."""

import math
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from css_monte_carlo.study import Configuration
from css_papers.study_columns import column

_MINUTE = 60.0


class Merit(NamedTuple):
    """What the cases of a configuration achieved; None: it cannot be said."""

    cases: int
    heading_error_late_deg: float | None  # mean over the cases, at the end of the flight
    heading_error_deg: float | None  # mean over the cases, after acquisition
    pointing_error_deg: float | None  # likewise, of array normal to true Sun
    rate_50min_deg_s: float | None
    rate_knowledge_50min_deg_s: float | None
    converging_mean_min: float | None
    converging_max_min: float | None  # None also when a case never converged
    converging_first_max_min: float | None  # first pass through sunlight
    converging_later_max_min: float | None  # after eclipse
    converged_percent: float | None
    acquired_mean_min: float | None  # since the epoch, over the cases that acquired
    acquired_p95_min: float | None


def merit(cases: pa.Table, configuration: Configuration) -> Merit:
    """Figures of merit of one configuration."""

    def of(name: str) -> np.ndarray:
        return column(cases, configuration, name)

    converging = of("converging_s") / _MINUTE
    acquired = of("acquired_s") / _MINUTE
    return Merit(
        cases=len(converging),
        heading_error_late_deg=_mean(of("heading_error_late_deg")),
        heading_error_deg=_mean(of("heading_error_mean_deg")),
        pointing_error_deg=_mean(of("pointing_error_mean_deg")),
        rate_50min_deg_s=_mean(of("rate_50min_deg_s")),
        rate_knowledge_50min_deg_s=_mean(of("rate_knowledge_50min_deg_s")),
        converging_mean_min=_mean(converging),
        converging_max_min=_longest(converging),
        converging_first_max_min=_longest(of("converging_first_s") / _MINUTE),
        converging_later_max_min=_longest(of("converging_later_s") / _MINUTE),
        converged_percent=100.0 * float(np.mean(np.isfinite(converging))) if len(converging) else None,
        acquired_mean_min=_mean(acquired),
        acquired_p95_min=float(np.nanpercentile(acquired, 95.0)) if np.isfinite(acquired).any() else None,
    )


def _mean(values: np.ndarray) -> float | None:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else None


def _longest(values: np.ndarray) -> float | None:
    longest = float(np.max(values, initial=-math.inf))
    return longest if math.isfinite(longest) else None
