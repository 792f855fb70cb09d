# SPDX-License-Identifier: Apache-2.0
"""Flies one orbit from a tumble, records it, replays it through every Sun estimator and draws what happened.

A spacecraft with eight coarse sun sensors tumbles at up to 2 deg/s about each axis. The Kalman filter finds the Sun
with help of a gyro, four reaction wheels turn the solar arrays to it, the recording is then stepped through weighted
average and Kalman filter, each with gyro and without.
"""

import argparse
import sys
from pathlib import Path

from css_analysis.estimator_runs import estimator_runs
from css_analysis.flight_log import read_flight
from css_bringup.commands.replay import print_replay
from css_bringup.figure_files import print_figures
from css_bringup.flight_result import default_bag
from css_bringup.fly_mission import fly, own_domain
from css_bringup.options import (
    add_domain_option,
    add_mission_options,
    add_output_options,
    complain,
    console,
    errors,
    guarded,
    mission_of,
)
from css_bringup.replay_bag import default_replay, replay
from css_bringup.replay_pass import parse_request
from css_bringup.report import flight_object, print_incidents, print_json, print_result, unmet
from css_common.command import FAILED, INTERRUPTED, CommandParser, command_parser
from css_common.progress_lines import still_working

_EXAMPLES = ("", "okeefe_2013 --duration 600 --out bags/first", "okeefe_2013 --case 7 --figures figures")
_EXITS = {0: "flown, and all pass criteria of the mission met", 1: "the flight failed or missed a criterion"}
_REPLAYED = ("ekf", "ekf:gyro=off", "wavg", "wavg:gyro=off")


def _parser() -> CommandParser:
    parser = command_parser("css_bringup", "demo", __doc__, _EXAMPLES, _EXITS)
    add_mission_options(parser)
    add_domain_option(parser)
    add_output_options(parser)
    parser.add_argument("--figures", type=Path, metavar="DIR", help="where figures go (default: beside the recording)")
    return parser


def main(args: list[str] | None = None) -> int:
    """Entry point."""
    parser = _parser()
    arguments = parser.parse_args(args)
    return guarded(parser.prog, lambda: _run(arguments))


def _run(arguments: argparse.Namespace) -> int:
    mission = mission_of(arguments)
    bag = arguments.out or default_bag(mission)
    console.print(
        f"Flying {mission.name}, case {mission.values.mission.case}: {mission.values.mission.duration:g} s simulated, "
        f"nodes {', '.join(node.name for node in mission.nodes)}",
        soft_wrap=True,
    )
    with own_domain(mission, arguments.domain, bag, console) as domain:
        flight = fly(mission, bag, processes=False, console=console, overwrite=arguments.overwrite)
    flight.domain = domain
    if flight.interrupted:
        errors.print(f"interrupted; the recording up to here is complete: {bag}", soft_wrap=True)
        return INTERRUPTED
    if flight.failure:
        print_incidents(flight)
        return FAILED
    log = read_flight(bag)
    flown = estimator_runs(log, [mission.values.graph.estimator])
    print_result(console, flight, flown)
    console.print("\nReplaying the recording through every Sun estimator, with gyro and without:")
    copy = default_replay(bag, overwrite=arguments.overwrite)
    with still_working(f"replaying {bag}"):
        replayed = replay(bag, copy, mission, map(parse_request, _REPLAYED), {}, overwrite=arguments.overwrite)
    print_replay(replayed)
    folder = arguments.figures or bag.with_name(f"{bag.name}_figures")
    print_figures(log, folder)
    print_figures(replayed.log, folder / "replay")
    runs = [*flown, *(run for run in replayed.runs if not run["flown"])]
    missed = unmet(flight, flown)
    for line in missed:
        complain("criterion missed:", line)
    print_incidents(flight)
    if arguments.json:
        print_json(flight_object(flight, runs))
    for line in replayed.shortcomings:
        complain("not as it should be:", line)
    return FAILED if missed or flight.notes or replayed.shortcomings else 0


if __name__ == "__main__":
    sys.exit(main())
