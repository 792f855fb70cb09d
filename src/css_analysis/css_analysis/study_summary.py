# SPDX-License-Identifier: Apache-2.0
"""Figures of merit of each configuration of a study over its cases."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from css_analysis.flight_metrics import windows_of
from css_analysis.intervals import Interval, mean_interval, percentile_interval, share_interval
from css_analysis.quantities import attitude_summaries, summaries
from css_analysis.quantity import Summary
from css_analysis.study_record import StudyRecord
from css_common.mission import mission_from_text

_NAMED = 5  # cases that a line names


def configuration_objects(study: StudyRecord) -> list[dict[str, Any]]:
    """One dictionary per configuration: means over the cases; None for what no case reached.

    `interval_95` has the ends of the 95 % interval of each, None for an end that too few cases tell. No cases bound the
    largest of all: for these it is the number itself, and None. `cases_with_value` says of how many cases each one is.
    """
    return [
        {
            "estimator": labels["estimator"],
            "gyro": "on" if labels["gyro"] else "off",
            "overrides": labels["overrides"].split(),
            **{
                summary.name: value_over(rows_of(study.cases, **labels), summary)
                for summary in summaries_of(study, labels["estimator"])
            },
            "interval_95": {
                summary.name: interval_over(rows_of(study.cases, **labels), summary)
                for summary in summaries_of(study, labels["estimator"])
            },
            "cases_with_value": {
                summary.name: cases_with_value(rows_of(study.cases, **labels), summary)
                for summary in summaries_of(study, labels["estimator"])
            },
        }
        for labels in study.manifest["configurations"]
    ]


def rows_of(table: pa.Table, **labels: Any) -> pa.Table:
    """The rows of a study's table that carry these labels (estimator, gyro, overrides, quantity)."""
    for name, value in labels.items():
        table = table.filter(pc.equal(table[name], value))
    return table


def some_cases(numbers: Sequence[int]) -> str:
    """The first few of the cases of which a line tells."""
    return ", ".join(map(str, numbers[:_NAMED])) + (", ..." if len(numbers) > _NAMED else "")


def summaries_of(study: StudyRecord, estimator: str) -> tuple[Summary, ...]:
    """What is told of the cases of a study's mission with one of its estimators."""
    mission = mission_from_text(study.manifest["mission_text"], str(study.folder))
    is_attitude_filter = estimator in study.manifest.get("attitude_filters", ())
    return (attitude_summaries if is_attitude_filter else summaries)(windows_of(mission))


def value_over(cases: pa.Table, summary: Summary) -> float | None:
    """A quantity over the cases of a configuration; None for what no case reached."""
    known = cases[summary.of].drop_null().to_numpy()
    if summary.over == "share":
        return len(known) / cases.num_rows
    if not len(known):
        return None
    if summary.over == "p95":
        return float(np.percentile(known, 95.0))
    return float(np.max(known) if summary.over == "max" else np.mean(known))


def cases_with_value(cases: pa.Table, summary: Summary) -> int:
    """How many cases of a configuration a quantity over them is of: of a share all, else those that have a value."""
    return int(cases.num_rows if summary.over == "share" else cases.num_rows - cases[summary.of].null_count)


def interval_over(cases: pa.Table, summary: Summary) -> Interval:
    """The 95 % interval of the same over all cases; of a largest value the number itself, and None."""
    known = cases[summary.of].drop_null().to_numpy()
    if summary.over == "share":
        return share_interval(len(known), cases.num_rows)
    if summary.over == "p95":
        return percentile_interval(known, 95.0)
    if summary.over == "max":
        return (float(np.max(known)) if len(known) else None, None)
    return mean_interval(np.asarray(known, dtype=np.float64))
