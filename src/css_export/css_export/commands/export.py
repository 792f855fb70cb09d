# SPDX-License-Identifier: Apache-2.0
"""Exports the compiled functions of a mission's estimators and control as C libraries for flight computers.

What is linked into the flight computer is the function that flew in simulation: compiled from the same source, for
another processor. With --verify the inputs of a recorded flight go through each library, and every output and every
state are compared with those of the function that flew, bit by bit.
"""

from collections.abc import Sequence
from pathlib import Path

from css_common.command import MISSION_HELP, CommandParser, command_parser, guarded, implementation
from css_common.mission_file import MissionError
from css_export.errors import ExportError, ToolError
from css_recording.errors import BagError

_EXAMPLES = (
    "okeefe_2013 --components ekf mrp_control -o flight_code",
    "okeefe_2013 --components ekf --target x86_64 aarch64 cortex-m7",
    "okeefe_2013 --components ekf --verify bags/okeefe_2013_0_20261122_125130 --json",
    "okeefe_2013 --components ekf --target x86_64 armv7 --mathematics musl -o flight_code",
    "okeefe_2013 --components ekf --target powerpc-unknown-elf:750 -o flight_code",
)
_EXITS = {
    1: "exported, and something differs from what flew, is of another export, or could not be run or compiled here",
    2: "what was asked for is wrong, or cannot be exported",
}


def _parser() -> CommandParser:
    parser = command_parser("css_export", "export", __doc__, _EXAMPLES, _EXITS)
    add = parser.add_argument
    add("mission", nargs="?", default="okeefe_2013", help=MISSION_HELP)
    add(
        "--components",
        nargs="+",
        default=[],
        metavar="NAME",
        help="estimators and controls of the mission (default: all of which there is a compiled function)",
    )
    add(
        "--target",
        nargs="+",
        default=["x86_64"],
        metavar="NAME",
        dest="targets",
        help="x86_64, aarch64, riscv64, armv7, cortex-m7, cortex-m4, leon3, or TRIPLE or TRIPLE:PROCESSOR as LLVM "
        "names them, of which objects alone are made (default: x86_64)",
    )
    add(
        "--mathematics",
        choices=("target", "musl"),
        default="target",
        help="whose sine, cosine and others: target: of the C library that the image is linked with; musl: one "
        "implementation in the library itself, so that all targets agree to the last bit (default: target)",
    )
    add("-o", "--out", type=Path, metavar="DIR", help="folder of the libraries (default: export/MISSION)")
    add("--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides", help="change one parameter")
    add("--verify", type=Path, metavar="BAG", help="compare the libraries with the functions that flew, step by step")
    add("--steps", type=int, metavar="N", help="with --verify: that many steps (default: all that are recorded)")
    add("--json", action="store_true", help="print the table as one JSON object on the last line")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(arguments)
    if options.steps is not None and (options.verify is None or options.steps < 1):
        parser.error("--steps: expected a whole number above 0, and --verify with it")
    run = implementation("css_export.verbs.export")
    wrong = (MissionError, ExportError, BagError)
    return guarded(parser.prog, lambda: run(options), wrong, (ToolError, OSError))
