# SPDX-License-Identifier: Apache-2.0
"""Replays a recording, and prints the comparison."""

import argparse

from css_analysis.flight_log import FlightLog
from css_analysis.flight_summary import isolated_lines, summary_table
from css_bringup.flight_pages import write_replay_page
from css_bringup.options import complain, console
from css_bringup.replay_bag import ReplayResult, default_replay, mission_of_bag, replay
from css_bringup.replay_pass import parse_request
from css_bringup.replay_verdict import is_rounding
from css_bringup.replayed import Replayed
from css_bringup.report import print_json
from css_common.command import FAILED
from css_common.mission_file import MissionError
from css_common.progress_lines import still_working
from css_sensors.calibrated_readings import calibration_sections


def run(arguments: argparse.Namespace) -> int:
    """Replays as the options say; the exit code."""
    remap = dict(_remapping(item) for item in arguments.remap)
    requests = [parse_request(text) for text in arguments.estimators]
    mission = mission_of_bag(arguments.bag, remap, arguments.overrides, arguments.mission)
    if arguments.calibration is not None:
        mission = mission.with_sections(calibration_sections(arguments.calibration))
    out = arguments.out or default_replay(arguments.bag, overwrite=arguments.overwrite)
    with still_working(f"replaying {arguments.bag}"):
        result = replay(
            arguments.bag,
            out,
            mission,
            requests,
            remap,
            overrides=arguments.overrides,
            overwrite=arguments.overwrite,
        )
    print_replay(result)
    if arguments.figures:
        from css_bringup.figure_files import print_figures  # matplotlib takes a second to load

        print_figures(result.log, arguments.figures)
    page = write_replay_page(result) if arguments.report else None
    if arguments.json:
        print_json(result.result_object() | {"page": None if page is None else str(page)})
    for line in result.shortcomings:
        complain("not as it should be:", line)
    return FAILED if result.shortcomings or (arguments.report and page is None) else 0


def _remapping(text: str) -> tuple[str, str]:
    old, separator, new = text.partition(":=")
    if not separator or not old or not new:
        raise MissionError(f"--remap {text!r}: expected OLD:=NEW")
    return old, new


def print_replay(result: ReplayResult) -> None:
    """The comparison as a table, with what was refused and whether bytes are as they flew."""
    console.print(summary_table(result.runs))
    for line in isolated_lines(result.runs):
        console.print(line, soft_wrap=True, highlight=False)
    console.print(f"mission: {result.mission.origin}", soft_wrap=True)
    if result.log.imported:
        console.print(_imported_line(result.log), soft_wrap=True)
    for run in result.replayed:
        for line in _lines(run, result.elsewhere):
            console.print(f"{run.label}: {line}", soft_wrap=True)
    for line in result.reports:
        console.print(f"noted: {line}", soft_wrap=True)
    for topic, kinds in result.missing.items():
        counted = ", ".join(f"{count} {kind}" for kind, count in kinds.items())
        console.print(f"readings of {topic} that counted as missing: {counted}", soft_wrap=True)
    rate = result.messages / result.cpu_s if result.cpu_s > 0.0 else 0.0
    console.print(
        f"{result.messages} estimates in {result.wall_s:.1f} s ({rate:.0f} a CPU second): {result.bag}", soft_wrap=True
    )


def _imported_line(log: FlightLog) -> str:
    """What the errors of imported telemetry are of."""
    if log.truth is None:
        return "imported telemetry: it has no truth, so that there are no errors to tell"
    unknown = [part for part in ("attitude", "rate", "position", "illumination") if not log.knows(part)]
    return f"imported telemetry: errors over all lines; not known: {', '.join((*unknown, 'solar arrays'))}"


def _lines(run: Replayed, elsewhere: str) -> list[str]:
    """What there is to say of one estimator."""
    lines = [*run.notes, *run.matcher.complaints()]
    comparison = run.comparison
    if comparison is not None:
        lines.append(comparison.text())
        if comparison.different and is_rounding(run, elsewhere):
            lines.append(f"rounding, as the software differs: {elsewhere}")
    return lines
