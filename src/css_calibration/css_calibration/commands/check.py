# SPDX-License-Identifier: Apache-2.0
"""Finds the cells of a recording that lie: each against the others, or against the Sun where it is known, over time.

Dead, stuck, saturated, noisy, shadowed from some directions, swapped with another, wrong sign, drifting with age and
the other kinds that flight software names, each with its evidence and the stretch of time.
"""

from collections.abc import Sequence

from css_calibration.recording_command import add_recording, run_command
from css_common.command import CommandParser, command_parser

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
    add_recording(parser)
    parser.add_argument(
        "--reference", choices=("auto", "truth", "batch", "cells"), default="auto",
        help="where the Sun was: its truth, attitude from rates, field and place, the vote of all cells (default: the "
        "first of these that there is)",
    )  # fmt: skip
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    return run_command(_parser(), arguments, "css_calibration.verbs.check")
