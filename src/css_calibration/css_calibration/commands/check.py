# SPDX-License-Identifier: Apache-2.0
"""Finds the cells of a recording that lie: each against the others, or against the Sun where it is known, over time.

Dead, stuck, saturated, noisy, shadowed from some directions, swapped with another, wrong sign, drifting with age and
the other kinds that flight software names, each with its evidence and the stretch of time.
"""

import os
import sys
from collections.abc import Sequence
from pathlib import Path

from css_common.command import CommandParser, command_parser, guarded, implementation
from css_common.mission_file import MissionError
from css_recording.errors import BagError

_EXAMPLES = (
    "bags/FLIGHT",
    "bags/FLIGHT --reference cells --json",
    "bags/FOREIGN --mission okeefe_2013 --remap /sensors/css:=/css/voltages",
)
_EXITS = {
    0: "every cell is healthy",
    1: "a cell is not",
    2: "the Sun is never known, or what is asked for is wrong",
}


def _parser() -> CommandParser:
    parser = command_parser("css_calibration", "check", __doc__, _EXAMPLES, _EXITS)
    parser.add_argument("bag", type=Path, help="recording: a rosbag2 folder or an .mcap file")
    parser.add_argument("--mission", metavar="NAME", help="cells and orbit of this mission, not of the recording's own")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides", help="change one parameter"
    )
    parser.add_argument(
        "--remap", nargs="+", default=[], metavar="OLD:=NEW", help="topics of the recording under the graph's names"
    )
    parser.add_argument(
        "--reference", choices=("auto", "truth", "batch", "cells"), default="auto",
        help="where the Sun was: its truth, attitude from rates, field and place, the vote of all cells (default: the "
        "first of these that there is)",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object on the last line")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(arguments)
    # matrices of a few hundred columns are slower on several threads, and their sums others
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from css_calibration.errors import CalibrationError

    run = implementation("css_calibration.verbs.check")
    return guarded(parser.prog, lambda: run(options), (MissionError, BagError, CalibrationError, OSError))


if __name__ == "__main__":
    sys.exit(main())
