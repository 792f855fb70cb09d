# SPDX-License-Identifier: Apache-2.0
"""What is measured of each case as columns, from the tallies that the loop kept."""

import numpy as np
import pyarrow as pa

from css_analysis.flight_metrics import Windows
from css_analysis.quantities import CaseSums, study_quantities
from css_monte_carlo.case_tallies import BIN_DEG, SAMPLED, Tallies


def case_table(numbers: np.ndarray, tallies: Tallies, period_s: float, windows: Windows) -> pa.Table:
    """One row a case: `study_quantities`, null for what never came, and the samples of each quantity as a list."""
    sums = CaseSums(tallies.totals, tallies.histogram, BIN_DEG, period_s)
    columns = {"case": pa.array(numbers, pa.uint32())}
    for quantity in study_quantities(windows):
        assert quantity.tally is not None  # or it were none of a study
        kind = pa.int64() if quantity.whole else pa.float64()
        columns[quantity.study_column] = pa.array(quantity.tally(sums), kind, from_pandas=True)
    for i, sampled in enumerate(SAMPLED):
        columns[sampled] = pa.array(list(tallies.samples[:, i]), pa.list_(pa.float32()))
    return pa.table(columns)
