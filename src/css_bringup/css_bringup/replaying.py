# SPDX-License-Identifier: Apache-2.0
"""Replaying a recording into a new one, and the comparison of what each estimator made of it."""

import json
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from css_bringup.replay import EstimatorRequest, Replay, Replayed
from css_bringup.report import result_object
from css_common.mission import Mission, default_mission, load_mission, mission_from_text
from css_recording.bag_reader import BagReader
from css_recording.bag_writer import BagWriter
from css_recording.provenance import software_versions
from css_studies.flight_log import FlightLog, read_flight
from css_studies.flight_metrics import Run, estimator_runs


@dataclass
class ReplayResult:
    """A finished replay.

    Attributes:
        source: recording that was read.
        bag: new recording.
        mission: whose parameters the estimators had.
        log: the new recording as columns.
        replayed: one entry an estimator.
        runs: figures of merit, in the same order.
        rejected: messages refused at the edge, by topic and kind.
        reports: what is to be known of the recording, and one line for each kind of refusal.
        simulated_s: time span of the recording [s].
        wall_s: wall time of reading and stepping [s].
        cpu_s: processor time of the same [s].
    """

    source: Path
    bag: Path
    mission: Mission
    log: FlightLog
    replayed: list[Replayed]
    runs: list[Run]
    rejected: Mapping[str, Mapping[str, int]]
    reports: list[str]
    simulated_s: float
    wall_s: float
    cpu_s: float

    @property
    def messages(self) -> int:
        """Estimates written."""
        return sum(run.messages for run in self.replayed)

    def result_object(self) -> dict[str, Any]:
        """What `--json` prints: the keys of a flight, and whether bytes are as they flew."""
        common = result_object(
            self.mission,
            self.runs,
            self.bag,
            simulated_s=self.simulated_s,
            wall_s=self.wall_s,
            cpu_s=self.cpu_s,
            recorded=self.messages,
            lost=0,
        )
        return common | {"rejected": {topic: dict(kinds) for topic, kinds in self.rejected.items()}}


def mission_of_bag(path: Path, remap: Mapping[str, str], overrides: Iterable[str], name: str | None) -> Mission:
    """The mission for a replay: a named one, else the one in the recording, else the default.

    Raises:
        MissionError: it is wrong.
        BagError: the recording cannot be read.
    """
    if name is not None:
        return load_mission(name, overrides)
    with BagReader(path, remap) as reader:
        text = reader.mission_text
    if text is not None:
        return mission_from_text(text, f"{path}: embedded mission", overrides)
    mission = default_mission()
    overrides = list(overrides)
    return mission.with_overrides(overrides) if overrides else mission


def replay(
    source: Path,
    bag: Path,
    mission: Mission,
    requests: Iterable[EstimatorRequest],
    remap: Mapping[str, str],
    *,
    overwrite: bool = False,
) -> ReplayResult:
    """Replays a recording through estimators into a new recording.

    Args:
        source: recording to read.
        bag: folder of the new recording: the estimates and the truth.
        mission: parameters of the estimators.
        requests: which estimators.
        remap: new names of the recording's topics.
        overwrite: replace a recording that is there.

    Raises:
        MissionError: an estimator or its inputs are missing.
        BagError: a recording cannot be read or written.
    """
    with BagReader(source, remap) as reader:
        stepping = Replay(reader, mission, requests)
        metadata = {"mission": mission.text(), "replay_of": str(source), **software_versions()}
        metadata["estimators"] = json.dumps({run.label: dict(run.node.canonical) for run in stepping.runs})
        wall = time.perf_counter()
        with BagWriter(bag, metadata=metadata, overwrite=overwrite) as writer:
            cpu_s = stepping.run(writer)
        wall_s = time.perf_counter() - wall
        simulated_s = reader.duration_ns * 1e-9
        notes = [*reader.notes, *map(str, reader.refused)]
    log = read_flight(bag)
    runs = [_named(run, figures) for run, figures in _paired(stepping.runs, log)]
    return ReplayResult(
        source,
        bag,
        mission,
        log,
        stepping.runs,
        runs,
        stepping.rejected,
        notes + stepping.reports,
        simulated_s,
        wall_s,
        cpu_s,
    )


def _paired(replayed: Iterable[Replayed], log: FlightLog) -> Iterable[tuple[Replayed, Run]]:
    figures = {run["estimator"]: run for run in estimator_runs(log)}
    return [(run, figures[run.label]) for run in replayed if run.label in figures]


def _named(run: Replayed, figures: Run) -> Run:
    # the log knows an estimator by its topic; what it stands for is known here
    use_gyro = getattr(run.node.values, "use_gyro", None)
    return figures | {
        "estimator": ":".join(filter(None, (run.node.name, run.changed))),
        "gyro": "on" if use_gyro in (True, None) else "off",
        "flown": run.comparison is not None,
        "topic": next(topic for topic, _ in run.outputs.values()),
        "identical": run.comparison.identical if run.comparison is not None else None,
    }
