# SPDX-License-Identifier: Apache-2.0
"""The frame around commands that look at a whole recording: whose cells it holds, what goes wrong, how they end."""

import os
import signal
from collections.abc import Sequence
from pathlib import Path

from css_common.command import CommandParser, guarded, implementation
from css_common.mission_file import MissionError
from css_recording.errors import BagError


def add_recording(parser: CommandParser) -> None:
    """The recording, and the options that say whose cells it holds."""
    parser.add_argument("bag", type=Path, help="recording: a rosbag2 folder or an .mcap file")
    parser.add_argument("--mission", metavar="NAME", help="cells and orbit of this mission, not of the recording's own")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides", help="change one parameter"
    )
    parser.add_argument(
        "--remap", nargs="+", default=[], metavar="OLD:=NEW", help="topics of the recording under the graph's names"
    )
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object on the last line")


def run_command(
    parser: CommandParser, arguments: Sequence[str] | None, module: str, interrupted: str = "interrupted"
) -> int:
    """Reads options and runs `run(prog, options)` of a module; the exit code.

    Args:
        arguments: None: those of the process.
        module: full name, loaded once options are read.
        interrupted: what Ctrl-C is answered with.
    """
    options = parser.parse_args(arguments)
    # matrices of a few hundred columns are slower on several threads, and their sums others
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # a killed terminal or `kill` end it as Ctrl-C does
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    from css_calibration.errors import CalibrationError

    run = implementation(module)
    wrong = (MissionError, BagError, CalibrationError, OSError)
    return guarded(parser.prog, lambda: run(parser.prog, options), wrong, interrupted=interrupted)
