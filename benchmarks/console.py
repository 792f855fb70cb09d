# SPDX-License-Identifier: Apache-2.0
"""What the console costs a flight that goes as fast as it can: alone, with the console, a browser, a stopped browser.

    ./sunpoint shell -c "python benchmarks/console.py --rounds 5"

The ways take turns, so that what else the machine does meets all of them alike. Processor time is that of the flight's
process, the console in it included, the browser's own not.
"""

import argparse
import contextlib
import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from statistics import median

from browser import Browser, browser_path

from css_bringup.composed import ComposedFlight
from css_common import domains
from css_common.mission import load_mission
from css_console.guards import new_token
from css_console.provision import provide

ALONE, SERVED, WATCHED, FROZEN = "alone", "console", "console and browser", "console and stopped browser"
WAYS = (ALONE, SERVED, WATCHED, FROZEN)


def fly(way: str, duration: float, libraries: Mapping[str, Path]) -> dict[str, float]:
    """One flight: wall and processor time [s] of its loop, and messages that a browser never got."""
    mission = load_mission("okeefe_2013", [f"mission.duration={duration}"])
    with domains.hold_free("flight", "benchmark of the console") as held, contextlib.ExitStack() as stack:
        os.environ["ROS_DOMAIN_ID"] = str(held.domain)
        flight = stack.enter_context(ComposedFlight(mission))
        if way != ALONE:
            from css_console.stage import Subject  # the server is there only now
            from css_console.thread import ConsoleThread

            thread = stack.enter_context(ConsoleThread(Subject("benchmark", "flight"), libraries, new_token(), 0))
            if way != SERVED:
                browser = stack.enter_context(Browser(browser_path() or "", 1400))
                browser.open(thread.address)
                browser.until("document.documentElement.dataset.frame !== undefined", "the page is there")
                if way == FROZEN:
                    browser.freeze()
                    stack.callback(browser.thaw)
        result = flight.fly()
        assert result.steps == mission.steps, result.failure
        return {"wall_s": result.wall_s, "cpu_s": result.cpu_s}


def main() -> int:
    """Flies in turns, and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5, help="flights of each way (default: 5)")
    parser.add_argument(
        "--duration", type=float, default=2000.0, metavar="S", help="simulated time [s] (default: 2000)"
    )
    parser.add_argument("--json", action="store_true", help="print the medians as one JSON object on the last line")
    options = parser.parse_args()
    libraries = provide(print)
    fly(ALONE, 10.0, libraries)  # loads what there is to load
    runs: dict[str, list[dict[str, float]]] = {way: [] for way in WAYS}
    for number in range(options.rounds):
        for way in WAYS[number % len(WAYS) :] + WAYS[: number % len(WAYS)]:
            runs[way].append(fly(way, options.duration, libraries))
            print(f"{way}: {runs[way][-1]}", file=sys.stderr, flush=True)
    print(f"{options.duration:g} s of okeefe_2013, medians of {options.rounds} flights")
    table = {}
    base = {key: median(run[key] for run in runs[ALONE]) for key in ("wall_s", "cpu_s")}
    for way, of_way in runs.items():
        wall, cpu = (median(run[key] for run in of_way) for key in ("wall_s", "cpu_s"))
        table[way] = {"factor": options.duration / wall, "factor_of_cpu": options.duration / cpu,
                      "slower": wall / base["wall_s"] - 1.0, "slower_of_cpu": cpu / base["cpu_s"] - 1.0}  # fmt: skip
        print(
            f"{way:28} {options.duration / wall:6.0f} x real time ({wall / base['wall_s'] - 1.0:+.1%})   "
            f"{options.duration / cpu:6.0f} x by processor time ({cpu / base['cpu_s'] - 1.0:+.1%})"
        )
    if options.json:
        print(json.dumps(table))
    return 0


if __name__ == "__main__":
    sys.exit(main())
