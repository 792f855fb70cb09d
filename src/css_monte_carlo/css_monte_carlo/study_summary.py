# SPDX-License-Identifier: Apache-2.0
"""A study in one object: figures of merit of each configuration over its cases."""

from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from css_analysis.flight_metrics import windows_of
from css_analysis.intervals import Interval, mean_interval, percentile_interval, share_interval
from css_analysis.quantities import Summary
from css_common.mission import mission_from_text
from css_monte_carlo.measures import ATTITUDE, HEADING
from css_monte_carlo.study import Study


def configuration_objects(study: Study) -> list[dict[str, Any]]:
    """One dictionary per configuration: means over the cases; None for what no case reached.

    `interval_95` has the ends of the 95 % interval of each, None for an end that too few cases tell. No cases bound the
    largest of all: for these it is the number itself, and None.
    """
    return [
        {
            "estimator": labels["estimator"],
            "gyro": "on" if labels["gyro"] else "off",
            "overrides": labels["overrides"].split(),
            **{
                summary.name: _over(rows_of(study.cases, **labels), summary)
                for summary in summaries_of(study, labels["estimator"])
            },
            "interval_95": {
                summary.name: _interval(rows_of(study.cases, **labels), summary)
                for summary in summaries_of(study, labels["estimator"])
            },
        }
        for labels in study.manifest["configurations"]
    ]


def study_object(study: Study, wall_s: float, cpu_s: float) -> dict[str, Any]:
    """What `monte-carlo --json` prints; cpu_ns_per_case_step is that of the loop, null when nothing was flown."""
    return {
        "mission": study.manifest["mission"],
        "cases": study.manifest["cases"],
        "steps": study.manifest["steps"],
        "wall_s": wall_s,
        "cpu_s": cpu_s,
        "cpu_ns_per_case_step": 1e9 * study.cpu_s / study.flown if study.flown else None,
        "configurations": configuration_objects(study),
        "out": str(study.folder),
        "warnings": list(study.warnings),
    }


def rows_of(table: pa.Table, **labels: Any) -> pa.Table:
    """The rows of a study's table that carry these labels (estimator, gyro, overrides, quantity)."""
    for name, value in labels.items():
        table = table.filter(pc.equal(table[name], value))
    return table


def summaries_of(study: Study, estimator: str) -> tuple[Summary, ...]:
    """What is told of the cases of a study's mission with one of its estimators."""
    mission = mission_from_text(study.manifest["mission_text"], str(study.folder))
    measure = ATTITUDE if estimator in study.manifest.get("attitude_filters", ()) else HEADING
    return measure.summaries(windows_of(mission))


def _over(cases: pa.Table, summary: Summary) -> float | None:
    known = cases[summary.of].drop_null().to_numpy()
    if summary.over == "share":
        return len(known) / cases.num_rows
    if not len(known):
        return None
    if summary.over == "p95":
        return float(np.percentile(known, 95.0))
    return float(np.max(known) if summary.over == "max" else np.mean(known))


def _interval(cases: pa.Table, summary: Summary) -> Interval:
    known = cases[summary.of].drop_null().to_numpy()
    if summary.over == "share":
        return share_interval(len(known), cases.num_rows)
    if summary.over == "p95":
        return percentile_interval(known, 95.0)
    if summary.over == "max":
        return (float(np.max(known)) if len(known) else None, None)
    return mean_interval(np.asarray(known, dtype=np.float64))
