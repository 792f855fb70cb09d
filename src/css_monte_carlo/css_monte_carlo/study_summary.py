# SPDX-License-Identifier: Apache-2.0
"""A study in one object: figures of merit of each configuration over its cases."""

from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from css_monte_carlo.measures import ATTITUDE
from css_monte_carlo.study import Study


def configuration_objects(study: Study) -> list[dict[str, Any]]:
    """One dictionary per configuration: means over the cases; None for what no case reached."""
    filters = study.manifest.get("attitude_filters", ())
    return [
        {
            "estimator": labels["estimator"],
            "gyro": "on" if labels["gyro"] else "off",
            "overrides": labels["overrides"].split(),
            **(_attitude_figures if labels["estimator"] in filters else _figures)(rows_of(study.cases, **labels)),
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


def _figures(cases: pa.Table) -> dict[str, Any]:
    converging = cases["converging_s"]
    return {
        "heading_error_mean_deg": _mean(cases, "heading_error_mean_deg"),
        "heading_error_p95_deg": _mean(cases, "heading_error_p95_deg"),
        "power_positive_fraction": 1.0 - cases["acquired_s"].null_count / cases.num_rows,
        "converging_max_s": pc.max(converging).as_py(),
        "converging_mean_s": _mean(cases, "converging_s"),
        "rate_50min_deg_s": _mean(cases, "rate_50min_deg_s"),
        "rate_knowledge_50min_deg_s": _mean(cases, "rate_knowledge_50min_deg_s"),
    }


def _attitude_figures(cases: pa.Table) -> dict[str, Any]:
    names = [name for name in ATTITUDE.figures if name != "attitude_error_max_deg"]
    return {
        **{name: _mean(cases, name) for name in names},
        "attitude_error_max_deg": pc.max(cases["attitude_error_max_deg"]).as_py(),
        "steps_without_estimate": _mean(cases, "steps_without_estimate"),
    }


def _mean(cases: pa.Table, name: str) -> float | None:
    values = cases[name].drop_null().to_numpy()
    return float(np.mean(values)) if len(values) else None
