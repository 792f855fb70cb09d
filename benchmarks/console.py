# SPDX-License-Identifier: Apache-2.0
"""What the console costs a flight that goes as fast as it can: beside it, with a browser, a stopped one, attached.

    ./sunpoint shell -c "python benchmarks/console.py --rounds 5"

The ways take turns, so that what else the machine does meets all of them alike. Processor time is that of the flight's
process, the console in it included; that of the browser stands beside it, as a share of the flight's wall time.
"""

import argparse
import asyncio
import contextlib
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from statistics import median

from browser import Browser, browser_path

from css_bringup.composed import ComposedFlight
from css_bringup.processes import executable_path
from css_common import domains
from css_common.mission import load_mission
from css_console.guards import new_token
from css_console.provision import provide

ALONE, SERVED, WATCHED, FROZEN, ATTACHED = (
    "alone",
    "console",
    "console and browser",
    "console and stopped browser",
    "attached console",
)
WAYS = (ALONE, SERVED, WATCHED, FROZEN, ATTACHED)


def fly(way: str, duration: float, rate: float, libraries: Mapping[str, Path]) -> dict[str, float]:
    """One flight: wall and processor time [s] of its loop, and processor time [s] of the browser meanwhile."""
    mission = load_mission("okeefe_2013", [f"mission.duration={duration}", f"lockstep.realtime_factor={rate}"])
    with domains.hold_free("flight", "benchmark of the console") as held, contextlib.ExitStack() as stack:
        os.environ["ROS_DOMAIN_ID"] = str(held.domain)
        flight = stack.enter_context(ComposedFlight(mission))
        browser = None
        if way == ATTACHED:
            stack.enter_context(attached())
        elif way != ALONE:
            from css_console.stage import Subject  # the server is there only now
            from css_console.thread import ConsoleThread

            thread = stack.enter_context(ConsoleThread(
                Subject("benchmark", "flight"), libraries, new_token(), 0, inside=flight.output_ports))  # fmt: skip
            if way != SERVED:
                browser = stack.enter_context(Browser(browser_path() or "", 1400))
                browser.open(thread.address)
                browser.until("document.documentElement.dataset.frame !== undefined", "the page is there")
                if way == FROZEN:
                    browser.freeze()
                    stack.callback(browser.thaw)
        before_s = browser.cpu_s() if browser else 0.0
        result = flight.fly()
        assert result.steps == mission.steps, result.failure
        browser_s = browser.cpu_s() - before_s if browser else 0.0
        return {"wall_s": result.wall_s, "cpu_s": result.cpu_s, "browser_s": browser_s}


@contextlib.contextmanager
def attached() -> Iterator[None]:
    """A console of another process that has found the flight, without a browser."""
    command = [executable_path("css_console", "console"), "--attach", "--port", "0"]
    env = os.environ | {"PYTHONUNBUFFERED": "1"}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=env) as process:
        assert process.stdout is not None
        address = next(found[1] for line in process.stdout if (found := re.search(r"console: (http://\S+)", line)))
        asyncio.run(seen(address))
        try:
            yield
        finally:
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=60.0)


async def seen(address: str) -> None:
    """Waits until a console has found the nodes of a flight; their topics come when it begins."""
    import aiohttp  # it is there only now

    async with aiohttp.ClientSession() as client, client.ws_connect(address + "socket") as line:
        while True:
            told = json.loads((await line.receive(timeout=120.0)).data)
            if told["type"] == "scene" and told["lifecycle"]:
                return


def main() -> int:
    """Flies in turns, and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5, help="flights of each way (default: 5)")
    parser.add_argument(
        "--duration", type=float, default=2000.0, metavar="S", help="simulated time [s] (default: 2000)"
    )
    parser.add_argument("--rate", type=float, default=0.0, help="times real time; 0: as fast as it goes (default)")
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=WAYS, metavar="WAY", help="default: all")
    parser.add_argument("--json", action="store_true", help="print the medians as one JSON object on the last line")
    options = parser.parse_args()
    libraries = provide(print)
    fly(ALONE, 10.0, 0.0, libraries)  # loads what there is to load
    ways = [way for way in WAYS if way in (ALONE, *options.ways)]
    runs: dict[str, list[dict[str, float]]] = {way: [] for way in ways}
    for number in range(options.rounds):
        for way in ways[number % len(ways) :] + ways[: number % len(ways)]:
            runs[way].append(fly(way, options.duration, options.rate, libraries))
            print(f"{way}: {runs[way][-1]}", file=sys.stderr, flush=True)
    print(f"{options.duration:g} s of okeefe_2013, medians of {options.rounds} flights; browser: share of a processor")
    table = {}
    for way, of_way in runs.items():
        wall, cpu = (median(run[key] for run in of_way) for key in ("wall_s", "cpu_s"))
        # each against the flight alone of its own round: what else the machine did is nearest to the same
        slower, slower_of_cpu = (
            median(run[key] / alone[key] for run, alone in zip(of_way, runs[ALONE], strict=True)) - 1.0
            for key in ("wall_s", "cpu_s")
        )
        share = median(run["browser_s"] / run["wall_s"] for run in of_way)
        table[way] = {"factor": options.duration / wall, "factor_of_cpu": options.duration / cpu, "slower": slower,
                      "slower_of_cpu": slower_of_cpu, "browser_share": share}  # fmt: skip
        print(
            f"{way:28} {options.duration / wall:6.0f} x real time ({slower:+.1%})   "
            f"{options.duration / cpu:6.0f} x by processor time ({slower_of_cpu:+.1%})   browser {share:.0%}"
        )
    if options.json:
        print(json.dumps(table))
    return 0


if __name__ == "__main__":
    sys.exit(main())
