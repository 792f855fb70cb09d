# SPDX-License-Identifier: Apache-2.0
"""Kills recorders at random instants, recovers what they wrote and tells how much simulated time is missing."""

import argparse
import json
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from css_recording.recovery import recover

STEP_NS = 20_000_000
# Writes as fast as it can, three topics a step, and says after each step that it has handed it over.
RECORDER = f"""
import sys
from css_recording.bag_metadata import Topic
from css_recording.bag_writer import BagWriter

topics = [Topic(name, "builtin_interfaces/msg/Time") for name in ("/a", "/b", "/c")]
with BagWriter(sys.argv[1], topics) as writer:
    for step in range(10**9):
        for topic in topics:
            writer.write(topic.name, step * {STEP_NS}, b"\\0\\1\\0\\0" + step.to_bytes(8, "little"))
        print(step, flush=True)
"""


def lost_seconds(folder: Path, dice: random.Random) -> float:
    """Simulated time [s] from the last stamp that is kept to the last that was handed over."""
    process = subprocess.Popen([sys.executable, "-c", RECORDER, str(folder)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    lines = [process.stdout.readline()]
    end = time.monotonic() + dice.uniform(0.0, 0.5)
    while time.monotonic() < end:
        lines.append(process.stdout.readline())
    process.kill()
    lines += process.stdout.readlines()
    process.wait()
    handed_over = int([line for line in lines if line.endswith("\n")][-1]) + 1
    kept = recover(folder).messages["/a"]
    return (handed_over - kept) * STEP_NS * 1e-9


def main() -> int:
    """Entry point; 1 when more than a second was lost."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=30, help="recorders to kill (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the instants (default: %(default)s)")
    options = parser.parse_args()
    dice = random.Random(options.seed)
    with tempfile.TemporaryDirectory() as folder:
        losses = [lost_seconds(Path(folder, str(number)), dice) for number in range(options.count)]
    mean = round(sum(losses) / len(losses), 3)
    print(json.dumps({"kills": len(losses), "most_lost_s": round(max(losses), 3), "mean_lost_s": mean}))
    return 1 if max(losses) > 1.0 else 0


if __name__ == "__main__":
    sys.exit(main())
