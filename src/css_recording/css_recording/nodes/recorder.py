# SPDX-License-Identifier: Apache-2.0
"""Recorder process: `recorder --help` tells how it is used."""

import argparse
import re
import sys
from collections.abc import Sequence
from pathlib import Path

from css_common.command import CommandParser, command_parser, implementation, positive
from css_common.stop_signal import StopSignal
from css_recording.ros_arguments import split_arguments

_DESCRIPTION = """\
Record topics into an MCAP recording in rosbag2 layout, until SIGINT (Ctrl-C) or SIGTERM. Log times are the stamps of
the messages. A flight with `lockstep.recorders` in its mission waits until the recorder hears every topic."""

_NOTES = """\
Parameter changes are recorded as /parameter_events. /clock and /rosout are recorded when named with --topic.
A file that is large or long enough is followed by the next, all in one folder: FOLDER_0.mcap, FOLDER_1.mcap, ..."""

_EXAMPLES = (
    "",
    "--mission okeefe_2013 -o bags/mine",
    "--topic css/voltages --topic gyro/imu",
    "--all --exclude rosout --exclude '^/debug/' --max-bag-duration 600",
)
_EXITS = {
    0: "the recording is complete",
    1: "it could not be written to its end, lacks messages, or a topic named with --topic never appeared",
    2: "an option or the mission is wrong, or the folder cannot be taken",
}

_SIZE = re.compile(r"(\d+)([kMG]?)")
_UNITS = {"": 1, "k": 10**3, "M": 10**6, "G": 10**9}


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    own, for_ros = split_arguments(sys.argv[1:] if arguments is None else arguments)
    parser = _parser()
    options = parser.parse_args(own)
    run = implementation("css_recording.verbs.record")
    return run(parser, options, for_ros, StopSignal())


def _bytes(text: str) -> int:
    match = _SIZE.fullmatch(text)
    value = int(match[1]) * _UNITS[match[2]] if match else 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text} given, expected bytes from 1 on, such as 500000 or 500M")
    return value


def _parser() -> CommandParser:
    parser = command_parser("css_recording", "recorder", _DESCRIPTION, _EXAMPLES, _EXITS, _NOTES)
    add = parser.add_argument
    add("--mission", metavar="NAME|FILE", help="record every topic that its graph publishes")
    add("--in-flight", action="store_true", help="the mission is being flown and waits for this recorder")
    add("--set", metavar="KEY=VALUE", action="append", default=[], help="override a mission value; may be repeated")
    add("--topic", action="append", default=[], help="record this topic; may be repeated")
    add("--all", action="store_true", help="record every topic that appears (default without others)")
    add(
        "--exclude", metavar="TOPIC|REGEX", action="append", default=[],
        help="leave out this topic, or those in whose names the expression is found; may be repeated",
    )  # fmt: skip
    add("-o", "--output", metavar="FOLDER", help="default: bags/NAME_TIME in the project")
    add("--overwrite", action="store_true", help="replace a recording that is there")
    add("--max-bag-size", metavar="BYTES", type=_bytes, help="begin a new file beyond this; k, M, G (default: never)")
    add("--max-bag-duration", metavar="S", type=positive, help="begin a new file after this time (default: never)")
    add(
        "--qos-profile-overrides-path", metavar="FILE", type=Path,
        help="quality of service of topics, in rosbag2's YAML (default: the strictest that matches the publishers)",
    )  # fmt: skip
    add("--notes", metavar="FILE", help="JSON list of lines to keep in the recording, read at its end")
    add("--summary", metavar="FILE", help="leave the figures of the recording in a JSON file")
    add("--json", action="store_true", help="print the result as one JSON object on the last line")
    return parser
