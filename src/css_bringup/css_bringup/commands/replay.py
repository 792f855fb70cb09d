# SPDX-License-Identifier: Apache-2.0
"""Steps estimators over a recording, without topics or clock, and compares what they make of it.

The recording may be Sunpoint's own or any rosbag2 recording (mcap or sqlite3) of the same message types. An estimator
is NAME or NAME:KEY=VALUE,..., for instance ekf:gyro=off or wavg:gate=0.4. The estimator that flew, replayed with the
parameters it had, gives the bytes that flew; the result says so.

What the mission scripted and what was set in flight happens to the estimators that it was addressed to, as in flight.
A value that is asked for here (NAME:KEY=VALUE, --set) stays.
"""

import argparse
import sys
from pathlib import Path

from css_analysis.flight_summary import summary_table
from css_bringup.options import complain, console, guarded
from css_bringup.replay_bag import ReplayResult, default_replay, mission_of_bag, replay
from css_bringup.replay_pass import parse_request
from css_bringup.replay_verdict import is_rounding
from css_bringup.replayed import Replayed
from css_bringup.report import print_json
from css_common.command import FAILED, CommandParser, command_parser
from css_common.mission_file import MissionError
from css_common.progress_lines import still_working

_EXAMPLES = (
    "bags/FLIGHT",
    "bags/FLIGHT --estimators wavg:gate=0.3 ekf:gyro=off --figures figures",
    "bags/FOREIGN --mission okeefe_2013 --remap /sensors/css:=/css/voltages",
)
_EXITS = {
    0: "each estimator gave estimates; one that flew gave the bytes that flew (values within 1e-6 on another machine)",
    1: "an estimator gave nothing, or its estimates differ from the flight or could not be compared with it",
}


def _parser() -> CommandParser:
    parser = command_parser("css_bringup", "replay", __doc__, _EXAMPLES, _EXITS)
    parser.add_argument("bag", type=Path, help="recording: a rosbag2 folder or an .mcap file")
    parser.add_argument(
        "--estimators", nargs="+", default=["wavg", "wavg:gyro=off", "ekf", "ekf:gyro=off"], metavar="NAME[:KEY=VALUE]",
        help="what to step over it (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument("--mission", metavar="NAME", help="parameters from this mission, not from the recording's own")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides", help="change one parameter"
    )
    parser.add_argument(
        "--remap", nargs="+", default=[], metavar="OLD:=NEW", help="topics of the recording under the graph's names"
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="new recording (default: BAG_replay, or _replay_2 ...)")
    parser.add_argument("--overwrite", action="store_true", help="replace a recording that is there")
    parser.add_argument("--figures", type=Path, metavar="DIR", help="write figures of the comparison as PNG")
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object on the last line")
    return parser


def main(args: list[str] | None = None) -> int:
    """Entry point; exit codes are in the description of the command."""
    parser = _parser()
    arguments = parser.parse_args(args)
    return guarded(parser.prog, lambda: _run(arguments))


def _run(arguments: argparse.Namespace) -> int:
    remap = dict(_remapping(item) for item in arguments.remap)
    requests = [parse_request(text) for text in arguments.estimators]
    mission = mission_of_bag(arguments.bag, remap, arguments.overrides, arguments.mission)
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
    if arguments.json:
        print_json(result.result_object())
    for line in result.shortcomings:
        complain("not as it should be:", line)
    return FAILED if result.shortcomings else 0


def _remapping(text: str) -> tuple[str, str]:
    old, separator, new = text.partition(":=")
    if not separator or not old or not new:
        raise MissionError(f"--remap {text!r}: expected OLD:=NEW")
    return old, new


def print_replay(result: ReplayResult) -> None:
    """The comparison as a table, with what was refused and whether bytes are as they flew."""
    console.print(summary_table(result.runs))
    console.print(f"mission: {result.mission.origin}", soft_wrap=True)
    if result.log.imported:
        console.print("imported telemetry: errors over all lines; of arrays, orbit and shadow nothing is known")
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


def _lines(run: Replayed, elsewhere: str) -> list[str]:
    """What there is to say of one estimator."""
    lines = [*run.notes, *run.matcher.complaints()]
    comparison = run.comparison
    if comparison is not None:
        lines.append(comparison.text())
        if comparison.different and is_rounding(run, elsewhere):
            lines.append(f"rounding, as the software differs: {elsewhere}")
    return lines


if __name__ == "__main__":
    sys.exit(main())
