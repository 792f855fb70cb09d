# SPDX-License-Identifier: Apache-2.0
"""What each estimator of a flight achieved."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from css_analysis.flight_log import FlightLog
from css_analysis.flight_metrics import EstimatorMeasures, FlightMeasures
from css_analysis.quantities import flight_quantities

Run = dict[str, Any]


def estimator_runs(log: FlightLog, names: Iterable[str] | None = None, flown: str | None = None) -> list[Run]:
    """One dictionary for each estimator: its name, gyro, flown, `quantities.flight_quantities`, isolated cells.

    Convergence, pointing errors and final rate belong to the flight: an estimator that was replayed or flew beside has
    those of the one that controlled.

    Args:
        names: estimators to report, all by default.
        flown: the estimator that controlled, when the log does not know.
    """
    flown = log.flown if flown is None else flown
    flight = FlightMeasures(log)
    return [
        {
            "estimator": name,
            "gyro": "on" if log.uses_gyro(name) else "off",
            "flown": name == flown,
            **_measured(EstimatorMeasures(flight, name)),
            "isolated_cells": _isolated_cells(log, name),
        }
        for name in ((*log.estimates, *log.attitudes) if names is None else names)
    ]


def _isolated_cells(log: FlightLog, name: str) -> list[int]:
    """Numbers of the cells that an estimator left out at some time for failed."""
    columns = log.estimates[name] if name in log.estimates else log.attitudes[name]
    ever = int(np.bitwise_or.reduce(columns.isolated))
    return [i for i in range(32) if ever >> i & 1]


def _measured(estimator: EstimatorMeasures) -> Run:
    asked_for = flight_quantities(estimator.flight.windows)
    return {name: q.measure(estimator) for name, q in asked_for.items() if q.measure is not None}
