# SPDX-License-Identifier: Apache-2.0
"""How estimates of each kind are measured in a study: running sums while flying, and the columns that they give."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from css_monte_carlo import attitude_table, attitude_tallies, case_table, case_tallies


class Measure(NamedTuple):
    """Of one kind of estimator."""

    figures: tuple[str, ...]  # columns of a case
    sampled: tuple[str, ...]  # quantities against time
    new_tallies: Callable[[int, int, float, int], Any]  # cases, steps, period [s], steps from sample to sample
    table: Callable[[np.ndarray, Any, float], pa.Table]  # case numbers, tallies, period [s]
    estimate_columns: int  # of a trace


HEADING = Measure(
    case_table.FIGURES,
    case_tallies.SAMPLED,
    case_tallies.new_tallies,
    case_table.case_table,
    case_tallies.ESTIMATE_COLUMNS,
)
"""Of a Sun estimator."""

ATTITUDE = Measure(
    attitude_table.FIGURES,
    attitude_tallies.SAMPLED,
    attitude_tallies.new_tallies,
    attitude_table.attitude_table,
    attitude_tallies.ESTIMATE_COLUMNS,
)
"""Of an attitude filter."""
