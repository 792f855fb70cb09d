# SPDX-License-Identifier: Apache-2.0
"""The pages that flights, demonstrations and replays end with."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from css_analysis.estimator_runs import Run
from css_analysis.faults_flown import FaultsFlown, faults_flown
from css_analysis.flight_log import FlightLog
from css_bringup.flight_result import FlightResult
from css_bringup.replay_bag import ReplayResult
from css_report.after_run import write_page_after
from css_report.edges import provenance_of
from css_report.flight_page import Flight, flight_page
from css_report.places import page_of


def write_flight_page(
    log: FlightLog, runs: Sequence[Run], flown: FaultsFlown, result: FlightResult, spinning: Sequence[str] = ()
) -> Path | None:
    """Writes the page of a flight beside its recording; None: it could not be written, which is said.

    Args:
        log: the flight.
        runs: figures of merit of its estimators.
        flown: its faults, and what was found of them.
        result: how it ended.
        spinning: lines about a payload that spins.
    """
    assert result.bag is not None  # or there were no log
    remarks = [*result.warnings, *([f"the flight failed: {result.failure}"] if result.failure else [])]
    remarks += ["the flight was interrupted"] if result.interrupted else []
    return _write("fly", log, runs, result.bag, flown, remarks, spinning)


def write_demo_page(log: FlightLog, runs: Sequence[Run], bag: Path, replayed: ReplayResult) -> Path | None:
    """Writes the page of a flight and of its replay through other estimators, as `write_flight_page`.

    Args:
        log: the flight.
        runs: figures of merit of the estimators that flew and of the others.
        bag: its recording.
        replayed: of it.
    """
    others = {run.label for run in replayed.replayed if run.comparison is None}
    estimates = {name: columns for name, columns in replayed.log.estimates.items() if name in others}
    both = replace(log, estimates=log.estimates | estimates)
    remarks = [*(f"replay: {line}" for line in replayed.incidents), *replay_remarks(replayed)]
    return _write("demo", both, runs, bag, faults_flown(log, bag), remarks)


def write_replay_page(result: ReplayResult) -> Path | None:
    """Writes the page of a replay, as `write_flight_page`."""
    flown = faults_flown(result.log, result.bag)
    return _write("replay", result.log, result.runs, result.bag, flown, replay_remarks(result))


def _write(
    prog: str,
    log: FlightLog,
    runs: Sequence[Run],
    bag: Path,
    flown: FaultsFlown,
    remarks: Sequence[str],
    spinning: Sequence[str] = (),
) -> Path | None:
    flight = Flight(log, runs, provenance_of(bag), flown, remarks, spinning)
    return write_page_after(prog, lambda: flight_page(flight), page_of(bag))


def replay_remarks(result: ReplayResult) -> list[str]:
    """What is to be known of a replay besides its incidents, which its recording tells, one line each."""
    lines = [f"replay: {line}" for line in result.reports if line not in result.incidents]
    for run in result.replayed:
        lines += [f"replay, {run.label}: {line}" for line in run.notes]
        if run.comparison is not None:
            lines.append(f"replay, {run.label}: {run.comparison.text()}")
    return [*lines, *(f"not as it should be: {line}" for line in result.shortcomings)]
