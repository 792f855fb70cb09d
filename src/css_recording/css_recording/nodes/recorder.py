# SPDX-License-Identifier: Apache-2.0
"""Recorder process: `recorder --help` tells how it is used."""

import argparse
import json
import re
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from rclpy.executors import Executor

from css_common.command import FAILED, CommandParser, command_parser, complain, guarded, positive
from css_common.executor import create_executor, retire, spin_until
from css_common.mission import load_mission
from css_common.mission_file import MissionError
from css_common.stop_signal import StopSignal
from css_recording.bag_folder import fresh_folder
from css_recording.bag_metadata import absolute
from css_recording.errors import BagError
from css_recording.process import RosArgumentsError, ros_process, split_arguments
from css_recording.qos_overrides import read_qos_overrides
from css_recording.recorder import RecorderNode
from css_recording.recording_choice import Excluded, RecordingChoice
from css_recording.split_bag_writer import FileLimits

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

_QUIET_S = 0.5  # a loaded machine delivers late what was published before the signal
_DRAIN_LIMIT_S = 5.0
_SIZE = re.compile(r"(\d+)([kMG]?)")
_UNITS = {"": 1, "k": 10**3, "M": 10**6, "G": 10**9}


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    own, for_ros = split_arguments(sys.argv[1:] if arguments is None else arguments)
    parser = _parser()
    options = parser.parse_args(own)
    stop = StopSignal()
    wrong = (MissionError, BagError, RosArgumentsError)
    return guarded(parser.prog, lambda: _run(parser, options, for_ros, stop), wrong)


def _run(parser: CommandParser, options: argparse.Namespace, for_ros: Sequence[str], stop: StopSignal) -> int:
    mission = load_mission(options.mission, options.set) if options.mission else None
    folder = Path(options.output) if options.output else fresh_folder(mission.name if mission else "recording")
    choice = _choice(options)
    everything = options.all or not (options.mission or options.topic)
    with ros_process("recorder", for_ros):
        node = RecorderNode(
            mission,
            folder,
            options.topic,
            everything=everything,
            overwrite=options.overwrite,
            in_flight=options.in_flight,
            choice=choice,
        )
        missing = _record(parser, options, node, folder, stop)
    return FAILED if node.failure or missing or node.faults() else 0


def _choice(options: argparse.Namespace) -> RecordingChoice:
    longest = options.max_bag_duration
    limits = FileLimits(options.max_bag_size, None if longest is None else round(longest * 1e9))
    choice = RecordingChoice(Excluded(options.exclude), read_qos_overrides(options.qos_profile_overrides_path), limits)
    for topic in options.topic:
        if absolute(topic) in choice.excluded:
            raise BagError(f"--topic {topic}: is excluded by --exclude")
    return choice


def _record(
    parser: CommandParser, options: argparse.Namespace, node: RecorderNode, folder: Path, stop: StopSignal
) -> list[str]:
    """Records until told to end; topics that were named and never appeared."""
    executor = create_executor()
    executor.add_node(node)
    try:
        node.get_logger().info(f"recording into {folder}")
        spin_until(executor, lambda: stop.came or bool(node.failure))
        _drain(executor, node)
    finally:
        node.close(_incidents(options.notes))
        missing = _say(parser, options, node, folder)
        retire(executor, node)
    return missing


def _drain(executor: Executor, node: RecorderNode) -> None:
    """Takes what was published before the signal and is still on its way."""
    limit = time.monotonic() + _DRAIN_LIMIT_S
    before = -1
    while before != node.message_count and time.monotonic() < limit:
        before = node.message_count
        quiet = time.monotonic() + _QUIET_S
        while time.monotonic() < quiet:
            executor.spin_once(timeout_sec=_QUIET_S / 10)


def _incidents(file: str | None) -> list[str]:
    """What the flight was like, as its supervisor left it."""
    if file is not None:
        with suppress(OSError, ValueError):  # a supervisor that died leaves none, or half of one
            return json.loads(Path(file).read_text(encoding="utf-8"))
    return []


def _say(parser: CommandParser, options: argparse.Namespace, node: RecorderNode, folder: Path) -> list[str]:
    """Prints what was recorded and what was not; topics that were named and never appeared."""
    print(_summary(node, folder), flush=True)
    named = {node.resolve_topic_name(topic) for topic in options.topic}
    missing = sorted(named.intersection(node.never_appeared))
    for topic in missing:
        complain(parser.prog, f"{topic} was named with --topic and never appeared")
    for fault in node.faults():
        complain(parser.prog, fault, "not as it should be")
    if node.failure:
        complain(parser.prog, node.failure)
    if options.summary:
        Path(options.summary).write_text(json.dumps(_figures(node)), encoding="utf-8")
    if options.json:
        print(json.dumps({"bag": str(folder), **_figures(node)}), flush=True)
    return missing


def _figures(node: RecorderNode) -> dict[str, Any]:
    return {
        "recorded": node.counts,
        "counters": node.counters,
        "never_appeared": node.never_appeared,
        "faults": node.faults(),
        "failure": node.failure,
        "cpu_s": time.process_time(),
    }


def _summary(node: RecorderNode, folder: Path) -> str:
    lines = [f"{folder}: {node.message_count or 'no'} messages"]
    lines += [f"  {count:9d}  {topic}" for topic, count in node.counts.items() if count]
    lines += [f"{name}: {count}" for name, count in node.counters.items() if count]
    lines += [f"never appeared: {topic}" for topic in node.never_appeared]
    return "\n".join(lines)


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


if __name__ == "__main__":
    sys.exit(main())
