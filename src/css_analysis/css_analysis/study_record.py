# SPDX-License-Identifier: Apache-2.0
"""A study that lies in a folder: what was asked for, one row a case, percentiles against time.

`css_monte_carlo` flies studies and writes these files; whoever reads one needs nothing of what flew it.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from css_analysis.errors import StudyError

MANIFEST, CASES, PERCENTILES = "study.json", "cases.parquet", "percentiles.parquet"
"""Files of a study; the last is written last, so that a study with it is complete."""


@dataclass(frozen=True)
class StudyRecord:
    """A complete study.

    Attributes:
        folder: where it lies.
        manifest: what was asked for.
        cases: one row per configuration and case: estimator, gyro, overrides, case and the quantities of
            `css_analysis.quantities`; null what is not of the kind of the estimator. With faults in the mission,
            `faults` lists those of the case; `drawn.KEY` is what the case drew for a dispersed parameter.
        percentiles: one row per configuration, quantity and time: count, mean, p05 to p95 over the cases.
    """

    folder: Path
    manifest: dict[str, Any]
    cases: pa.Table
    percentiles: pa.Table


def is_complete(folder: Path) -> bool:
    """Whether all results of a study are there."""
    return (folder / PERCENTILES).exists()


def read_record(folder: str | Path) -> StudyRecord:
    """A study that lies in a folder.

    Raises:
        StudyError: it is not there, not complete or damaged.
    """
    folder = Path(folder)
    if not is_complete(folder):
        raise StudyError(f"{folder}: holds no complete study")
    try:
        manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        return StudyRecord(folder, manifest, pq.read_table(folder / CASES), pq.read_table(folder / PERCENTILES))
    except (OSError, ValueError, pa.ArrowException) as error:
        raise StudyError(f"{folder}: damaged: {error}") from error
