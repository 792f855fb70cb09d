# SPDX-License-Identifier: Apache-2.0
"""Finishes the recording of a recorder that was killed. `recover --help` tells how it is used."""

from collections.abc import Sequence
from pathlib import Path

from css_common.command import USAGE, CommandParser, command_parser, complain, guarded, implementation
from css_recording.errors import BagError

_DESCRIPTION = """\
Finish a recording whose recorder was killed: keep every intact chunk, index it, and write the metadata that
the recorder had no time for. A folder whose metadata.yaml is lost or wrong gets a new one. A complete recording is
left as it is; one that is damaged elsewhere than at its end is refused unless an output is named."""

_EXAMPLES = ("bags/FLIGHT", "bags/FLIGHT -o bags/mended")
_EXITS = {0: "the recording is complete (now)", 1: "it cannot be recovered", 2: "there is none, or an option is wrong"}


def _parser() -> CommandParser:
    parser = command_parser("css_recording", "recover", _DESCRIPTION, _EXAMPLES, _EXITS)
    parser.add_argument("recording", type=Path, help="folder of the recording, or its .mcap file")
    parser.add_argument(
        "-o", "--output", metavar="FOLDER",
        help="write the finished recording to this new folder, the torn one stays (default: mend it in place)",
    )  # fmt: skip
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(arguments)
    if not options.recording.exists():
        complain(parser.prog, f"{options.recording}: there is no such recording")
        return USAGE
    run = implementation("css_recording.verbs.recover")
    return guarded(parser.prog, lambda: run(options.recording, options.output), (), (BagError,))
