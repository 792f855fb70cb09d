# SPDX-License-Identifier: Apache-2.0
"""Tables of a study that nobody flew, of the form that `css_monte_carlo` gives."""

import numpy as np
import pyarrow as pa

from css_analysis.flight_metrics import Windows
from css_analysis.quantities import study_quantities
from css_monte_carlo.case_tallies import SAMPLED

NAMES = [
    quantity.study_column
    for quantity in study_quantities(Windows(late_time=300.0, report_time=3000.0))
    if not quantity.whole
]


def case_table(configurations, cases, values=None, seed=1):
    """Table `cases`: random values below 2, but for those given by configuration and column."""
    random = np.random.default_rng(seed)
    rows = []
    for configuration in configurations:
        given = (values or {}).get(configuration, {})
        for case in range(cases):
            row = {name: float(random.uniform(0.0, 2.0)) for name in NAMES}
            row |= {name: column[case] for name, column in given.items()}
            rows.append(_key(configuration) | {"case": case, "steps_without_estimate": 0} | row)
    return pa.Table.from_pylist(rows)


def percentile_table(configurations, time_s, value=lambda configuration, quantity, time_s: np.exp(-time_s / 600.0)):
    """Table `percentiles`: the mean is as given, the 95th percentile twice that."""
    rows = []
    for configuration in configurations:
        for quantity in SAMPLED:
            means = value(configuration, quantity, time_s)
            for time, mean in zip(time_s, means, strict=True):
                spread = {
                    name: factor * float(mean)
                    for name, factor in (("p05", 0.1), ("p25", 0.5), ("p50", 0.9), ("p75", 1.2), ("p95", 2.0))
                }
                rows.append(
                    _key(configuration)
                    | {"quantity": quantity, "time_s": float(time), "count": 10, "mean": float(mean)}
                    | spread
                )
    return pa.Table.from_pylist(rows)


def _key(configuration):
    return {
        "estimator": configuration.estimator,
        "gyro": configuration.gyro,
        "overrides": " ".join(configuration.overrides),
    }
