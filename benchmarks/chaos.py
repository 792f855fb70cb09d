# SPDX-License-Identifier: Apache-2.0
"""Kills, freezes and strangers in real flights: what becomes of them, and whether they say so.

Each kind is flown a number of times, every flight with other instants of harm. Counted are exit codes, flights that
differ from the undisturbed one without a word (must be none), messages missing without a word (must be none),
tracebacks in logs (must be none) and processes left behind (must be none). The last line is a JSON object.
"""

import argparse
import json
import sys
import tempfile
from collections import Counter
from pathlib import Path

import chaos_flights as flights

KINDS = {
    "kill_node": (flights.kill_nodes, 20),
    "freeze_node": (flights.freeze_nodes, 20),
    "kill_plant": (flights.kill_plant, 20),
    "freeze_plant": (flights.freeze_plant, 20),
    "kill_recorder": (flights.kill_recorder, 100),
    "freeze_recorder": (flights.freeze_recorder, 20),
    "kill_supervisor": (flights.kill_supervisor, 20),
    "freeze_supervisor": (flights.freeze_supervisor, 20),
    "stranger": (flights.strangers, 10),
    "two_flights": (flights.two_flights, 10),
}
_MUST_BE_NONE = ("wrong", "lost_silently", "tracebacks", "left_behind")


def main() -> int:
    """Entry point; 1 when something happened that must not."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS), metavar="KIND", help=", ".join(KINDS))
    parser.add_argument("--count", type=int, help="flights of each kind (default: 10, 20 or 100)")
    parser.add_argument("--faulted", action="store_true", help="in flights with faults of sensors, a wheel, messages")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the counts here too")
    arguments = parser.parse_args()
    counts: dict[str, dict[str, int]] = {}
    with tempfile.TemporaryDirectory(prefix="sunpoint_chaos_") as folder:
        reference = flights.Reference(Path(folder), faulted=arguments.faulted)
        for kind in arguments.kinds:
            fly, usual = KINDS[kind]
            counted: Counter[str] = Counter()
            for number in range(arguments.count or usual):
                place = Path(folder) / f"{kind}_{number}"
                place.mkdir()
                for outcome in fly(reference, place, arguments.seed * 1000 + number):
                    counted.update(outcome.counts())
                    # one that is interrupted has said how far it came
                    counts[kind] = dict(sorted(counted.items()))
                    print(f"{kind:18}", counts[kind], flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(counts, indent=1), encoding="utf-8")
    print(json.dumps(counts))
    return int(any(counted.get(key) for counted in counts.values() for key in _MUST_BE_NONE))


if __name__ == "__main__":
    sys.exit(main())
