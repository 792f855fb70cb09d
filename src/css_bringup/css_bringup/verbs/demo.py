# SPDX-License-Identifier: Apache-2.0
"""Flies, replays and draws."""

import argparse

from css_analysis.estimator_runs import estimator_runs
from css_analysis.flight_log import read_flight
from css_bringup.flight_pages import write_demo_page
from css_bringup.flight_result import default_bag
from css_bringup.fly_mission import fly, own_domain
from css_bringup.mission_asked_for import mission_of
from css_bringup.options import complain, console, errors
from css_bringup.replay_bag import default_replay, replay
from css_bringup.replay_pass import parse_request
from css_bringup.report import flight_object, print_incidents, print_json, print_result, unmet
from css_bringup.verbs.replay import print_replay
from css_common.command import FAILED, INTERRUPTED
from css_common.progress_lines import still_working

_REPLAYED = ("ekf", "ekf:gyro=off", "wavg", "wavg:gyro=off")


def run(arguments: argparse.Namespace) -> int:
    """Flies, replays and draws as the options say; the exit code."""
    mission = mission_of(arguments)
    bag = arguments.out or default_bag(mission)
    console.print(
        f"Flying {mission.name}, case {mission.values.mission.case}: {mission.values.mission.duration:g} s simulated, "
        f"nodes {', '.join(node.name for node in mission.nodes)}",
        soft_wrap=True,
    )
    with own_domain(mission.name, arguments.domain, bag, console) as domain:
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
    from css_bringup.figure_files import print_figures  # matplotlib takes a second to load, which may pass later

    folder = arguments.figures or bag.with_name(f"{bag.name}_figures")
    print_figures(log, folder)
    print_figures(replayed.log, folder / "replay")
    runs = [*flown, *(run for run in replayed.runs if not run["flown"])]
    page = write_demo_page(log, runs, bag, replayed) if arguments.report else None
    missed = unmet(flight, flown)
    for line in missed:
        complain("criterion missed:", line)
    print_incidents(flight)
    if arguments.json:
        print_json(flight_object(flight, runs) | {"page": None if page is None else str(page)})
    for line in replayed.shortcomings:
        complain("not as it should be:", line)
    unwritten = arguments.report and page is None
    return FAILED if missed or flight.notes or replayed.shortcomings or unwritten else 0
