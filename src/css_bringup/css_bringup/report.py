# SPDX-License-Identifier: Apache-2.0
"""The result of a flight or a replay, as a table for people and as JSON for scripts."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from css_analysis.estimator_runs import Run
from css_analysis.flight_summary import Verdict, criteria_failures, criteria_verdicts, isolated_lines, summary_table
from css_bringup.flight_result import FlightResult
from css_bringup.options import complain
from css_common.mission import Mission
from css_msgs.msg import ControlStatus


def result_object(
    mission: Mission,
    runs: Sequence[Run],
    bag: Path | None,
    *,
    simulated_s: float,
    wall_s: float,
    cpu_s: float,
    recorded: int,
    lost: int,
) -> dict[str, Any]:
    """What `--json` prints, of a flight and of a replay alike."""
    return {
        "mission": mission.name,
        "case": mission.values.mission.case,
        "seed": mission.values.mission.seed,
        "simulated_s": round(simulated_s, 6),
        "wall_s": round(wall_s, 3),
        "cpu_s": round(cpu_s, 3),
        "realtime_factor": round(simulated_s / wall_s, 1) if wall_s > 0.0 else 0.0,
        "messages_recorded": recorded,
        "messages_lost": lost,
        "bag": str(bag) if bag else None,
        "runs": list(runs),
    }


def flight_object(result: FlightResult, runs: Sequence[Run]) -> dict[str, Any]:
    """The JSON object of a flight."""
    criteria = [{**verdict._asdict(), "passed": verdict.passed} for verdict in verdicts(result, runs)]
    common = result_object(
        result.mission,
        runs,
        result.bag,
        simulated_s=result.simulated_s,
        wall_s=result.wall_s,
        cpu_s=result.cpu_s,
        recorded=result.messages_recorded,
        lost=result.messages_lost,
    )
    return common | {
        "domain": result.domain,
        "failure": result.failure,
        "incidents": result.notes,
        "warnings": result.warnings,
        "criteria": criteria,
    }


def print_result(console: Console, result: FlightResult, runs: Sequence[Run]) -> None:
    """The table and the figures of the flight."""
    if runs:
        console.print(summary_table(runs))
    for line in isolated_lines(runs):
        console.print(line, soft_wrap=True, highlight=False)
    for verdict in verdicts(result, runs):
        console.print(verdict.line(), style="" if verdict.passed else "red", soft_wrap=True)
    simulated = f"{result.simulated_s:.1f} s simulated"
    if result.wall_s > 0.0:  # a plant that was killed took its times with it
        simulated += (
            f" in {result.wall_s:.1f} s wall, {result.cpu_s:.1f} s CPU: {result.realtime_factor:.0f} times real time"
        )
    console.print(simulated)
    if result.bag is not None:
        console.print(
            f"{result.messages_recorded} messages recorded, {result.messages_lost} lost: {result.bag}", soft_wrap=True
        )


def print_incidents(result: FlightResult) -> None:
    """What was not as it should be, and why it ended early: the last lines of a flight."""
    for note in result.notes:
        complain("not as it should be:", note)
    if result.failure:
        complain("the flight failed:", result.failure)


def print_json(value: Mapping[str, Any]) -> None:
    """One JSON object on one line."""
    print(json.dumps(value, allow_nan=False), flush=True)


def unmet(result: FlightResult, runs: Sequence[Run]) -> list[str]:
    """Pass criteria of the mission that the flown estimator missed; in a flight without control, any estimator."""
    return criteria_failures(result.mission.criteria, _judged(result, runs))


def verdicts(result: FlightResult, runs: Sequence[Run]) -> list[Verdict]:
    """What became of each pass criterion of a flight that came to its end."""
    if result.failure or result.interrupted:
        return []
    return criteria_verdicts(result.mission.criteria, _judged(result, runs))


def _judged(result: FlightResult, runs: Sequence[Run]) -> list[Run]:
    controlled = any(kind is ControlStatus for kind in result.mission.topics.values())
    return [run for run in runs if run["flown"] or not controlled]
