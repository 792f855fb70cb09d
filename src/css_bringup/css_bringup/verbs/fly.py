# SPDX-License-Identifier: Apache-2.0
"""Flies a mission, and says what came of it."""

import argparse
import os
from collections.abc import Mapping

from css_analysis.estimator_runs import Run, estimator_runs
from css_analysis.faults_flown import NOTHING_FLOWN, faults_flown
from css_analysis.flight_log import read_flight
from css_analysis.spin_flight import read_spinning
from css_analysis.spin_summary import spin_lines, spin_object
from css_bringup.flight_director import Wish
from css_bringup.flight_pages import write_flight_page
from css_bringup.flight_result import FlightResult, default_bag
from css_bringup.fly_mission import fly, own_domain
from css_bringup.mission_asked_for import mission_of, overrides_of
from css_bringup.options import complain, console, errors
from css_bringup.processes import RECORDER
from css_bringup.report import flight_object, print_incidents, print_json, print_result, unmet
from css_bringup.stand_ins import stand_ins
from css_bringup.staying import Staying, fly_and_stay
from css_common import security
from css_common.command import FAILED, INTERRUPTED
from css_common.component import Component
from css_common.mission import Mission
from css_recording.errors import BagError


def run(arguments: argparse.Namespace) -> int:
    """Flies as the options say; the exit code."""
    if arguments.realtime is not None:
        arguments.overrides.append(f"lockstep.realtime_factor={arguments.realtime}")
    mission = mission_of(arguments)
    components = stand_ins(mission, arguments.components)
    for text in arguments.components:
        console.print(f"in the place of a compiled function: {text}", soft_wrap=True)
    bag = None if arguments.no_record or arguments.stay else (arguments.out or default_bag(mission))
    nodes = [*(node.name for node in mission.nodes), RECORDER]
    enclaves = security.enclaves_of(nodes, arguments.processes)
    with (
        security.enforced(os.environ, arguments.security, enclaves),
        own_domain(mission.name, arguments.domain, bag, console) as domain,
    ):
        if arguments.stay:
            return _stay(arguments, mission, domain)
        result = fly(
            mission,
            bag,
            processes=arguments.processes,
            console=console,
            overwrite=arguments.overwrite,
            stand_ins=components,
        )
    result.domain = domain
    return conclude(mission, result, as_json=arguments.json, with_page=arguments.report)


def _stay(arguments: argparse.Namespace, mission: Mission, domain: int) -> int:
    def end(flown: Mission, result: FlightResult) -> int:
        result.domain = domain
        return conclude(flown, result, as_json=arguments.json, with_page=arguments.report)

    wish = Wish(arguments.mission, tuple(overrides_of(arguments)), arguments.paused)

    def components_of(flown: Mission) -> dict[str, type[Component]]:
        return stand_ins(flown, arguments.components)

    bag_of = (lambda _: None) if arguments.no_record else default_bag
    return fly_and_stay(wish, mission, Staying(bag_of, console, end, stand_ins_of=components_of))


def conclude(
    mission: Mission,
    result: FlightResult,
    *,
    as_json: bool,
    further: Mapping[str, object] | None = None,
    with_page: bool = False,
) -> int:
    """Prints a flight's result, writes its page and turns it into an exit code; `further` goes into its JSON object."""
    runs: list[Run] = []
    failed, log = NOTHING_FLOWN, None
    if result.bag is not None and result.steps > 0:
        try:
            log = read_flight(result.bag)
            runs, failed = estimator_runs(log), faults_flown(log, result.bag)
        except BagError as error:
            # a recorder that died leaves such a recording, and why it died is the better news
            result.failure = result.failure or str(error)
    print_result(console, result, runs)
    for line in failed.faults:
        console.print(f"fault: {line}", soft_wrap=True, highlight=False)
    for found in failed.detections:
        console.print(f"detection: {found.text()}", soft_wrap=True, highlight=False)
    for line in failed.warnings:
        complain("warning:", line)
    result.warnings += failed.warnings
    spinning = None if result.bag is None or result.failure else read_spinning(result.bag)
    told = [] if spinning is None else spin_lines(spinning)
    for line in told:
        console.print(line, soft_wrap=True)
    flown = not (result.failure or result.interrupted)
    missed = unmet(result, runs) if flown and result.bag is not None else []
    for line in missed:
        complain("criterion missed:", line)
    page = None if log is None or not with_page else write_flight_page(log, runs, failed, result, told)
    print_incidents(result)
    if as_json:
        print_json(
            flight_object(result, runs)
            | {"faults": failed.faults, "detections": failed.objects(), "page": None if page is None else str(page)}
            | ({} if spinning is None else {"spin": spin_object(spinning)})
            | dict(further or {})
        )
    if result.interrupted:
        errors.print("interrupted" + ("; the recording up to here is complete" if result.bag is not None else ""))
        return INTERRUPTED
    unwritten = with_page and log is not None and page is None
    return FAILED if result.failure or result.notes or missed or unwritten else 0
