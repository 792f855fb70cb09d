# SPDX-License-Identifier: Apache-2.0
"""A study says which faults were not found, and what was left out without one."""

from pathlib import Path

import pyarrow as pa
import pytest

from css_analysis.study_health import health_of_cases
from css_analysis.study_record import StudyRecord

_NOTHING = {
    "fault_shown_s": None,
    "undetected_units": 0,
    "misnamed_units": 0,
    "false_isolations": 0,
    "false_actuator_isolations": 0,
    "falsely_left_sensors": 0,
}
_LABELS = {"estimator": "ekf", "gyro": False, "overrides": ""}


def _study(*rows, labels=_LABELS):
    table = pa.Table.from_pylist([labels | {"case": 7 + number} | _NOTHING | row for number, row in enumerate(rows)])
    return StudyRecord(Path("a_study"), {"configurations": [labels]}, table, pa.table({}))


def test_a_study_without_faults_in_which_nothing_was_left_out_says_nothing():
    assert health_of_cases(_study({}, {})) == []


def test_faults_that_were_not_found_are_named_by_their_cases():
    shown = {"fault_shown_s": 1.5}
    (health,) = health_of_cases(_study(shown, shown | {"undetected_units": 1}, {}, shown | {"misnamed_units": 1}))
    assert list(health.lines()) == [
        "ekf, gyro off: a fault showed in 3 of 4 cases and was found in 2 of them, not in case 8",
        "ekf, gyro off: a failed cell was taken for what it is not in case 10",
    ]
    assert health.as_object() == {
        "estimator": "ekf",
        "gyro": "off",
        "overrides": [],
        "cases": 4,
        "shown": 3,
        "undetected": [8],
        "misnamed": [10],
        "false_isolations": [],
        "false_actuator_isolations": [],
        "falsely_left_sensors": [],
    }


@pytest.mark.parametrize(
    ("column", "unit"),
    [
        ("false_isolations", "a cell"),
        ("false_actuator_isolations", "a wheel or rod"),
        ("falsely_left_sensors", "a gyro or magnetometer"),
    ],
)
def test_healthy_units_that_were_left_out_are_told(column, unit):
    labels = {"estimator": "wavg", "gyro": True, "overrides": "css_array.noise=0.1"}
    (health,) = health_of_cases(_study(*[{column: 2}] * 6, {}, labels=labels))
    name, cases = "wavg, gyro on, css_array.noise=0.1", "6 cases (7, 8, 9, 10, 11, ...)"
    assert list(health.lines()) == [f"{name}: {unit} that had not failed was held for failed in {cases}"]


def test_a_study_of_before_these_columns_is_read():
    table = pa.Table.from_pylist([_LABELS | {"case": 0}])
    assert health_of_cases(StudyRecord(Path("old"), {"configurations": [_LABELS]}, table, pa.table({}))) == []
