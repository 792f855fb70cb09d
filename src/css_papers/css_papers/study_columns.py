# SPDX-License-Identifier: Apache-2.0
"""One configuration out of the tables of a study."""

from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from css_monte_carlo.study import Configuration


class Curve(NamedTuple):
    """A quantity of all cases against time."""

    time_s: np.ndarray  # (T,) since the epoch
    mean: np.ndarray  # (T,) over the cases; NaN: no case has it
    p95: np.ndarray  # (T,) 95th percentile


def column(cases: pa.Table, configuration: Configuration, name: str) -> np.ndarray:
    """(C,) float64 values of a column of a study's `cases` for one configuration; NaN: null."""
    values = _rows(cases, configuration).column(name).to_numpy()
    return np.asarray(values, dtype=np.float64)


def curve(percentiles: pa.Table, configuration: Configuration, quantity: str) -> Curve:
    """A quantity of a study's `percentiles` for one configuration."""
    table = _rows(percentiles, configuration)
    table = table.filter(pc.equal(table.column("quantity"), quantity)).sort_by("time_s")
    return Curve(*(np.asarray(table.column(name).to_numpy(), dtype=np.float64) for name in ("time_s", "mean", "p95")))


def _rows(table: pa.Table, configuration: Configuration) -> pa.Table:
    same = pc.and_(
        pc.and_(
            pc.equal(table.column("estimator"), configuration.estimator),
            pc.equal(table.column("gyro"), configuration.gyro),
        ),
        pc.equal(table.column("overrides"), " ".join(configuration.overrides)),
    )
    return table.filter(same)


def mean_of(values: np.ndarray) -> float | None:
    """Mean over the cases that have a number; None when none has."""
    known = values[np.isfinite(values)]
    return float(np.mean(known)) if len(known) else None
