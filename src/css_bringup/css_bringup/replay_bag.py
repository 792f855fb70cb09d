# SPDX-License-Identifier: Apache-2.0
"""Replaying a recording into a new one, and the comparison of what each estimator made of it."""

import json
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from css_analysis.estimator_runs import Run, estimator_runs
from css_analysis.flight_log import FlightLog, read_flight
from css_bringup.estimator_request import EstimatorRequest
from css_bringup.replay_incidents import replay_incidents
from css_bringup.replay_pass import Replay
from css_bringup.replay_verdict import shortcomings, software_apart
from css_bringup.replayed import Replayed
from css_bringup.report import result_object
from css_common.mission import Mission, MissionError, load_mission, mission_from_text
from css_environment.orbit_checks import recorded_orbit_findings
from css_estimation.health.coarse_steps import coarse_lines
from css_recording.bag_folder import free_name
from css_recording.bag_reader import BagReader
from css_recording.bag_writer import BagWriter
from css_recording.provenance import IMPORTED_FROM, INCIDENTS, NOTHING, REPLAY_INCIDENTS, software_versions


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
        missing: readings that counted as missing, by topic, field and kind.
        reports: what is to be known of the recording, and one line for each kind of refusal.
        incidents: what was refused, missed or failed, how many and why, as the new recording tells it.
        elsewhere: what differs between the software of the flight and this one; empty: nothing.
        simulated_s: time from the first to the last stamp that was replayed [s].
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
    missing: Mapping[str, Mapping[str, int]]
    reports: list[str]
    incidents: list[str]
    elsewhere: str
    simulated_s: float
    wall_s: float
    cpu_s: float

    @property
    def messages(self) -> int:
        """Estimates written."""
        return sum(run.messages for run in self.replayed)

    @property
    def shortcomings(self) -> list[str]:
        """What keeps the replay from being a success, one line each."""
        return [line for run in self.replayed for line in shortcomings(run, self.elsewhere)]

    def result_object(self) -> dict[str, Any]:
        """What `--json` prints: the keys of a flight, and for each estimator what it gave and how that compares."""
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
        return common | {
            "parameters": self.mission.origin,
            "software_differs": self.elsewhere or None,
            "replayed": [_replayed_object(run) for run in self.replayed],
            "shortcomings": self.shortcomings,
            "incidents": self.incidents,
            "rejected": {topic: dict(kinds) for topic, kinds in self.rejected.items()},
            "missing_readings": {topic: dict(kinds) for topic, kinds in self.missing.items()},
        }


def default_replay(source: Path, *, overwrite: bool = False) -> Path:
    """Where the replay of a recording goes: `BAG_replay` beside it, with a number where that is taken.

    Args:
        source: rosbag2 folder or file.
        overwrite: a replay that is there may be replaced.
    """
    base = source.with_name(f"{source.stem if source.is_file() else source.name}_replay")
    return base if overwrite else free_name(base)


def mission_of_bag(path: Path, remap: Mapping[str, str], overrides: Iterable[str], name: str | None) -> Mission:
    """The mission for a replay: a named one, else the one in the recording.

    Raises:
        MissionError: it is wrong, or there is none.
        BagError: the recording cannot be read.
    """
    if name is not None:
        return load_mission(name, overrides)
    with BagReader(path, remap) as reader:
        text = reader.mission_text
    if text is not None:
        return mission_from_text(text, f"{path}: embedded mission", overrides)
    raise MissionError(f"{path}: holds no mission; whose cells and orbit are these? --mission NAME says it")


def replay(
    source: Path,
    bag: Path,
    mission: Mission,
    requests: Iterable[EstimatorRequest],
    remap: Mapping[str, str],
    *,
    overrides: Iterable[str] = (),
    overwrite: bool = False,
) -> ReplayResult:
    """Replays a recording through estimators into a new recording.

    Args:
        source: recording to read.
        bag: folder of the new recording: the estimates and the truth.
        mission: parameters of the estimators.
        requests: which estimators.
        remap: new names of the recording's topics.
        overrides: KEY=VALUE that were asked for in `mission`; what changed in flight does not touch them.
        overwrite: replace a recording that is there.

    Raises:
        MissionError: an estimator or its inputs are missing.
        BagError: a recording cannot be read or written.
    """
    with BagReader(source, remap) as reader:
        stepping = Replay(reader, mission, requests, overrides)
        metadata = {"mission": mission.text(), "replay_of": str(source), **software_versions()}
        if IMPORTED_FROM in reader.description:
            metadata[IMPORTED_FROM] = reader.description[IMPORTED_FROM]
        metadata["estimators"] = json.dumps({run.label: dict(run.node.canonical) for run in stepping.runs})
        wall = time.perf_counter()
        with BagWriter(bag, metadata=metadata, overwrite=overwrite) as writer:
            cpu_s = stepping.run(writer)
            damaged = [*map(str, reader.refused)]
            incidents = [*damaged, *replay_incidents(stepping)]
            notes = {REPLAY_INCIDENTS: "\n".join(incidents) or NOTHING}
            if INCIDENTS in reader.description:
                notes[INCIDENTS] = reader.description[INCIDENTS]
            writer.close(notes)
        wall_s = time.perf_counter() - wall
        elsewhere = software_apart(reader.description)
    log = read_flight(bag)
    runs = [_named(run, figures, log) for run, figures in _paired(stepping.runs, log)]
    return ReplayResult(
        source,
        bag,
        mission,
        log,
        stepping.runs,
        runs,
        stepping.rejected,
        stepping.missing,
        [*reader.notes, *damaged, *stepping.reports, *_places_in_doubt(stepping), *_too_coarse(stepping, log)],
        incidents,
        elsewhere,
        (stepping.last_ns - stepping.first_ns) * 1e-9,
        wall_s,
        cpu_s,
    )


def _places_in_doubt(stepping: Replay) -> list[str]:
    """What is wrong with the element sets by which estimators know their place, at the time of the recording."""
    lines: dict[str, None] = {}
    for run in stepping.runs:
        if hasattr(run.node.values, "orbit"):
            found = recorded_orbit_findings(run.node.values, stepping.first_ns, stepping.last_ns)
            lines |= dict.fromkeys(f"{run.label}: {finding.text}" for finding in found)
    return list(lines)


def _too_coarse(stepping: Replay, log: FlightLog) -> list[str]:
    """What the steps of the recording are too long to tell of the health of sensors."""
    lines: dict[str, None] = {}
    for run in stepping.runs:
        if run.label in log.estimates:
            lines |= dict.fromkeys(coarse_lines(run.node.values, log.estimates[run.label].stamp_ns))
    return list(lines)


def _paired(replayed: Iterable[Replayed], log: FlightLog) -> Iterable[tuple[Replayed, Run]]:
    figures = {run["estimator"]: run for run in estimator_runs(log)}
    return [(run, figures[run.label]) for run in replayed if run.label in figures]


def _named(run: Replayed, figures: Run, log: FlightLog) -> Run:
    # the log knows an estimator by its topic; what it stands for is known here
    use_gyro = getattr(run.node.values, "use_gyro", None)
    return figures | {
        "estimator": ":".join(filter(None, (run.node.name, run.changed))),
        "gyro": "on" if use_gyro is None or (use_gyro and log.had_gyro(run.label)) else "off",
        "flown": run.comparison is not None,
        "topic": next(iter(run.topics.values())),
        "identical": run.comparison.identical if run.comparison is not None else None,
    }


def _replayed_object(run: Replayed) -> dict[str, Any]:
    return {
        "label": run.label,
        "estimates": run.messages,
        "failures": run.failures,
        "unmatched_inputs": run.matcher.unmatched,
        "missing_inputs": run.matcher.complaints(),
        "comparison": run.comparison.as_object() if run.comparison is not None else None,
        "notes": run.notes,
    }
