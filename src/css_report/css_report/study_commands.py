# SPDX-License-Identifier: Apache-2.0
"""The worst cases of a study, each with the command that flies it on the graph."""

import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from css_analysis.configured_mission import configuring_overrides
from css_analysis.quantity import Summary
from css_analysis.study_record import StudyRecord
from css_analysis.study_summary import summaries_of
from css_common.mission import Mission, MissionError, load_mission, mission_from_text
from css_common.whole_files import write_whole
from css_report.errors import ReportError
from css_report.study_plots import configuration_label, values_of

MISSION_FILE = "mission.yaml"
"""The mission of a study that is none of `config/`, in the folder of the study."""
_WORST = 3  # cases named of a quantity
_HIGHER_IS_BETTER = ("power_positive_late",)


class WorstCase(NamedTuple):
    """One case."""

    configuration: str
    quantity: str
    value: float | None  # None: it never came to one
    unit: str
    case: int
    command: str


def mission_reference(study: StudyRecord) -> str:
    """What a command calls the mission of a study: its name, or the file that is written into the study's folder.

    Raises:
        ReportError: the file cannot be written.
    """
    name, text = study.manifest["mission"], study.manifest["mission_text"]
    try:
        if load_mission(name).with_overrides(["mission.case=0"]).text() == text:
            return str(name)
    except MissionError:
        pass
    file = study.folder / MISSION_FILE
    try:
        if not file.is_file() or file.read_text(encoding="utf-8") != text:
            write_whole(file, text)
    except OSError as error:
        raise ReportError(f"{file}: the mission that flew cannot be written: {error.strerror}") from error
    return str(Path(file))


def fly_command(reference: str, mission: Mission, labels: dict[str, Any], case: int) -> str:
    """The command that flies one case of a configuration.

    Args:
        reference: name or file of the mission.
        mission: the same, read.
        labels: estimator, gyro and overrides of the configuration.
        case: its number.

    Raises:
        MissionError: the configuration does not fit the mission.
    """
    overrides = [*configuring_overrides(mission, labels["estimator"], labels["gyro"]), *labels["overrides"].split()]
    words = ["./sunpoint", "fly", reference, "--case", str(case)]
    for override in overrides:
        words += ["--set", override]
    return shlex.join(words)


def worst_cases(study: StudyRecord, reference: str) -> Iterator[WorstCase]:
    """For each configuration and quantity that is told of it, the cases that did worst; those without a value first."""
    mission = mission_from_text(study.manifest["mission_text"], str(study.folder))
    for labels in study.manifest["configurations"]:
        columns: dict[str, Summary] = {}
        for summary in summaries_of(study, labels["estimator"]):
            columns.setdefault(summary.of, summary)
        for column, summary in columns.items():
            if column not in study.cases.column_names:
                continue
            values = values_of(study, labels, column)
            numbers = study_numbers(study, labels)
            for i in worst_rows(values, column in _HIGHER_IS_BETTER)[:_WORST]:
                value = None if np.isnan(values[i]) else float(values[i])
                command = fly_command(reference, mission, labels, int(numbers[i]))
                yield WorstCase(configuration_label(labels), column, value, summary.unit, int(numbers[i]), command)


def study_numbers(study: StudyRecord, labels: dict[str, Any]) -> np.ndarray:
    """(C,) numbers of the cases of a configuration."""
    return values_of(study, labels, "case").astype(np.int64)


def worst_rows(values: np.ndarray, higher_is_better: bool) -> np.ndarray:
    """Rows of values (C,) from the worst on; without a value is worst, of equal ones the first case comes first."""
    badness = np.where(np.isnan(values), np.inf, -values if higher_is_better else values)
    if np.all(badness == badness[0]) if len(badness) else True:
        return np.empty(0, np.int64)
    return np.argsort(-badness, kind="stable")
