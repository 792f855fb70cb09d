# SPDX-License-Identifier: Apache-2.0
"""What is measured of each case as columns, from the tallies that the loop kept."""

import numpy as np
import pyarrow as pa

from css_analysis.flight_metrics import Windows
from css_analysis.quantity import CaseSums
from css_monte_carlo.case_tallies import BIN_DEG, Tallies
from css_monte_carlo.measures import ATTITUDE, HEADING, CaseTallies, Measure


def case_table(numbers: np.ndarray, tallies: CaseTallies, period_s: float, windows: Windows) -> pa.Table:
    """One row a case: quantities, null for what never came, and the samples of each sampled quantity as a list."""
    measure = measure_of(tallies)
    health = tallies.health if isinstance(tallies, Tallies) else None
    sums = CaseSums(tallies.totals, tallies.histogram, BIN_DEG, period_s, health)
    columns = {"case": pa.array(numbers, pa.uint32())}
    for quantity in measure.quantities(windows):
        values = quantity.tally if measure is HEADING else quantity.attitude_tally
        assert values is not None  # or it were none of this kind
        kind = pa.int64() if quantity.whole else pa.float64()
        columns[quantity.study_column] = pa.array(values(sums), kind, from_pandas=True)
    for i, sampled in enumerate(measure.sampled):
        columns[sampled] = pa.array(list(tallies.samples[:, i]), pa.list_(pa.float32()))
    return pa.table(columns)


def measure_of(tallies: CaseTallies) -> Measure:
    """The kind of estimator that some tallies are of."""
    return next(measure for measure in (HEADING, ATTITUDE) if isinstance(tallies, measure.tallies))
