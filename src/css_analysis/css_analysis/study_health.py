# SPDX-License-Identifier: Apache-2.0
"""What a study says of the health of units: faults that were not found, and healthy units that were left out."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import pyarrow as pa
import pyarrow.compute as pc

from css_analysis.study_record import StudyRecord
from css_analysis.study_summary import rows_of, some_cases

_FALSE = {
    "false_isolations": "a cell",
    "false_actuator_isolations": "a wheel or rod",
    "falsely_left_sensors": "a gyro or magnetometer",
}


class HealthOfCases(NamedTuple):
    """Of one configuration; cases by their numbers.

    Attributes:
        labels: estimator, gyro and overrides.
        cases: how many there are.
        shown: in how many of them a fault showed.
        undetected: in which a unit was not found whose fault showed.
        misnamed: in which a failed cell was last taken for what it is not.
        false: in which units were held for failed that were not, by the column that counts them.
    """

    labels: Mapping[str, Any]
    cases: int
    shown: int
    undetected: list[int]
    misnamed: list[int]
    false: dict[str, list[int]]

    def lines(self) -> Iterator[str]:
        """In words; nothing where nothing failed and nothing was left out."""
        gyro = "gyro on" if self.labels["gyro"] else "gyro off"
        name = ", ".join(filter(None, (self.labels["estimator"], gyro, self.labels["overrides"])))
        if self.shown:
            found = self.shown - len(self.undetected)
            yield f"{name}: a fault showed in {self.shown} of {self.cases} cases and was found in {found} of them" + (
                f", not in {_cases(self.undetected)}" if self.undetected else ""
            )
        if self.misnamed:
            yield f"{name}: a failed cell was taken for what it is not in {_cases(self.misnamed)}"
        for column, unit in _FALSE.items():
            if self.false[column]:
                yield f"{name}: {unit} that had not failed was held for failed in {_cases(self.false[column])}"

    def as_object(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "estimator": self.labels["estimator"],
            "gyro": "on" if self.labels["gyro"] else "off",
            "overrides": self.labels["overrides"].split(),
            **{name: getattr(self, name) for name in ("cases", "shown", "undetected", "misnamed")},
            **self.false,
        }


def _cases(numbers: list[int]) -> str:
    named = some_cases(numbers)
    return f"{len(numbers)} cases ({named})" if len(numbers) > 1 else f"case {named}"


def health_of_cases(study: StudyRecord) -> list[HealthOfCases]:
    """Of each configuration in which a fault showed or a unit was left out that had none."""
    found = [_of(rows_of(study.cases, **labels), labels) for labels in study.manifest["configurations"]]
    return [health for health in found if health.shown or any(health.false.values())]


def _of(cases: pa.Table, labels: Mapping[str, Any]) -> HealthOfCases:
    return HealthOfCases(
        labels,
        cases.num_rows,
        len(cases["fault_shown_s"].drop_null()) if "fault_shown_s" in cases.column_names else 0,
        _with(cases, "undetected_units"),
        _with(cases, "misnamed_units"),
        {column: _with(cases, column) for column in _FALSE},
    )


def _with(cases: pa.Table, column: str) -> list[int]:
    """Numbers of the cases in which something was counted; none in studies without the column."""
    if column not in cases.column_names:
        return []
    return cases.filter(pc.greater(cases[column], 0))["case"].to_pylist()
