# SPDX-License-Identifier: Apache-2.0
"""A study in one object: figures of merit of each configuration over its cases, and what they cost."""

from typing import Any

from css_analysis.study_health import health_of_cases
from css_analysis.study_summary import configuration_objects
from css_monte_carlo.study import Study


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
        "health": [health.as_object() for health in health_of_cases(study)],
        "out": str(study.folder),
        "warnings": list(study.warnings),
    }
