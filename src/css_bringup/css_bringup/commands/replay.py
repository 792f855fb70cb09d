# SPDX-License-Identifier: Apache-2.0
"""Steps estimators over a recording, without topics or clock, and compares what they make of it.

The recording may be Sunpoint's own or any rosbag2 recording (mcap or sqlite3) of the same message types. An estimator
is NAME or NAME:KEY=VALUE,..., for instance ekf:gyro=off or wavg:gate=0.4. The estimator that flew, replayed with the
parameters it had, gives the bytes that flew; the result says so.
"""

import argparse
import sys
from pathlib import Path

from css_bringup.figures import print_figures
from css_bringup.options import FAILED, complain, console, guarded
from css_bringup.replay import parse_request
from css_bringup.replaying import ReplayResult, mission_of_bag, replay
from css_bringup.report import print_json
from css_common.mission_file import MissionError
from css_studies.flight_summary import summary_table


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="replay", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
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
    parser.add_argument("--out", type=Path, metavar="DIR", help="new recording (default: BAG_replay)")
    parser.add_argument("--overwrite", action="store_true", help="replace a recording that is there")
    parser.add_argument("--figures", type=Path, metavar="DIR", help="write figures of the comparison as PNG")
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object on the last line")
    return parser


def main(args: list[str] | None = None) -> int:
    """Entry point; 0 when every asked-for estimator gave estimates."""
    arguments = _parser().parse_args(args)
    return guarded(lambda: _run(arguments))


def _run(arguments: argparse.Namespace) -> int:
    remap = dict(_remapping(item) for item in arguments.remap)
    requests = [parse_request(text) for text in arguments.estimators]
    mission = mission_of_bag(arguments.bag, remap, arguments.overrides, arguments.mission)
    default = arguments.bag.with_name(f"{arguments.bag.stem if arguments.bag.is_file() else arguments.bag.name}_replay")
    result = replay(
        arguments.bag, arguments.out or default, mission, requests, remap, overwrite=arguments.overwrite
    )
    print_replay(result)
    if arguments.figures:
        print_figures(result.log, arguments.figures)
    if arguments.json:
        print_json(result.result_object())
    silent = [run.label for run in result.replayed if run.messages == 0]
    if silent:
        complain(f"no estimate from {', '.join(silent)}:", "their inputs never met in one stamp")
        return FAILED
    return 0


def _remapping(text: str) -> tuple[str, str]:
    old, separator, new = text.partition(":=")
    if not separator or not old or not new:
        raise MissionError(f"--remap {text!r}: expected OLD:=NEW")
    return old, new


def print_replay(result: ReplayResult) -> None:
    """The comparison as a table, with what was refused and whether bytes are as they flew."""
    console.print(summary_table(result.runs))
    for run in result.replayed:
        comparison = run.comparison
        if comparison is None:
            continue
        if comparison.identical:
            console.print(f"{run.label}: all {comparison.compared} estimates are the bytes that flew")
        else:
            first = min(comparison.different, default=None)
            console.print(
                f"{run.label}: {len(comparison.different)} of {comparison.compared} estimates differ from the flight"
                + (f", first at {first} ns" if first is not None else "")
                + (f"; {comparison.unmatched} stand on one side only" if comparison.unmatched else "")
            )
    for line in result.reports:
        console.print(f"note: {line}", soft_wrap=True)
    rate = result.messages / result.cpu_s if result.cpu_s > 0.0 else 0.0
    console.print(
        f"{result.messages} estimates in {result.wall_s:.1f} s ({rate:.0f} a CPU second): {result.bag}", soft_wrap=True
    )


if __name__ == "__main__":
    sys.exit(main())
