# SPDX-License-Identifier: Apache-2.0
"""The pass criteria of a mission over the cases of a study: how many meet all of them, and whether that is enough.

A mission that says `measures.required_share` has its criteria judge studies too. A case meets a criterion as a flight
does: within its limits, both included; a quantity without a value meets none.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from css_analysis.flight_metrics import windows_of
from css_analysis.intervals import share_interval
from css_analysis.quantities import QUANTITIES, flight_quantities, needed_windows
from css_analysis.study_record import StudyRecord
from css_analysis.study_summary import rows_of, some_cases
from css_common.mission import SHARED, Mission, MissionError, mission_from_text
from css_common.schema import unknown_name


class Judged(NamedTuple):
    """One configuration of a study under the criteria."""

    labels: dict[str, Any]  # estimator, gyro, overrides
    cases: int
    met: int  # cases that meet all criteria
    required: int  # cases that must
    missed: dict[str, list[int]]  # criterion as QUANTITY.min or QUANTITY.max: numbers of the cases that miss it

    @property
    def passed(self) -> bool:
        """Enough cases meet the criteria."""
        return self.met >= self.required

    def lines(self) -> list[str]:
        """PASS or FAIL, and which criteria are missed by which cases."""
        name = " ".join(filter(None, (self.labels["estimator"], self.labels["overrides"])))
        word = "PASS" if self.passed else "FAIL"
        low, high = share_interval(self.met, self.cases)
        sure = f"95 % interval {low:.1%} to {high:.1%}"
        lines = [
            f"{word}  {self.met} of {self.cases} cases meet the criteria, must be {self.required}, {sure}  ({name})"
        ]
        for criterion, numbers in self.missed.items():
            if numbers:
                lines.append(f"      {criterion} is missed by {len(numbers)}: case {some_cases(numbers)}")
        return lines

    def as_object(self) -> dict[str, Any]:
        """What `--json` says."""
        return {
            "met": self.met,
            "required": self.required,
            "met_share_interval_95": share_interval(self.met, self.cases),
            "missed": {k: len(v) for k, v in self.missed.items()},
        }


def refuse_unknown_criteria(mission: Mission) -> None:
    """Looks at the criteria before a flight or study that they will judge.

    Raises:
        MissionError: there is no such quantity, or the mission does not say how it is measured.
    """
    measured = flight_quantities(windows_of(mission))
    for quantity in mission.criteria:
        if quantity not in QUANTITIES:
            raise MissionError(f"{mission.origin}: {SHARED}: criteria.{unknown_name(quantity, QUANTITIES)}")
        if quantity not in measured:
            needs = " and ".join(f"measures.{name}" for name in needed_windows(quantity))
            raise MissionError(f"{mission.origin}: {SHARED}: criteria.{quantity}: measured only with {needs} above 0")


def judge(study: StudyRecord) -> list[Judged]:
    """Every configuration under the criteria of the study's mission; none where these judge flights alone."""
    mission = mission_from_text(study.manifest["mission_text"], str(study.folder))
    share = mission.values.measures.required_share
    if share == 0.0 or not mission.criteria:
        return []
    return [
        _judged(labels, rows_of(study.cases, **labels), mission.criteria, share)
        for labels in study.manifest["configurations"]
    ]


def _judged(
    labels: dict[str, Any], rows: pa.Table, criteria: Mapping[str, Mapping[str, float]], share: float
) -> Judged:
    numbers = rows["case"].to_numpy()
    met = np.ones(len(numbers), dtype=bool)
    missed: dict[str, list[int]] = {}
    for quantity, limits in criteria.items():
        values = _values(rows, QUANTITIES[quantity].study_column)
        for bound, limit in limits.items():
            good = values >= limit if bound == "min" else values <= limit
            missed[f"{quantity}.{bound} {limit:g}"] = numbers[~good].tolist()
            met &= good
    required = int(np.ceil(share * len(numbers) - 1e-9))
    return Judged(labels, len(numbers), int(np.count_nonzero(met)), required, missed)


def _values(rows: pa.Table, column: str) -> np.ndarray:
    """(C,) values of a column, NaN for none and for a quantity that the study does not measure."""
    if column not in rows.column_names:
        return np.full(rows.num_rows, np.nan)
    return rows[column].cast(pa.float64()).to_numpy()
