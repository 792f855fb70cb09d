# SPDX-License-Identifier: Apache-2.0
"""Recorder process: `recorder --help` tells how it is used."""

import argparse
import json
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import rclpy
from rclpy.executors import Executor
from rclpy.signals import SignalHandlerOptions

from css_common.executor import create_executor, retire, spin_until
from css_common.mission import Mission, load_mission
from css_common.mission_file import MissionError
from css_common.stop_signal import StopSignal
from css_recording.bag_folder import fresh_folder
from css_recording.errors import BagError
from css_recording.process import split_arguments
from css_recording.recorder import INCIDENTS, RecorderNode

_DESCRIPTION = """\
Record topics into an MCAP recording in rosbag2 layout, until SIGINT or SIGTERM. Log times are the stamps of the
messages. A flight with `lockstep.recorders` in its mission waits until the recorder hears every topic."""

_EPILOG = """\
Parameter changes are recorded as /parameter_events. /clock and /rosout are recorded when named with --topic.
Exit code: 0 the recording is complete, 1 it could not be created or written, 2 wrong usage or mission."""

_QUIET_S = 0.5  # a loaded machine delivers late what was published before the signal
_DRAIN_LIMIT_S = 5.0


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    own, for_ros = split_arguments(sys.argv[1:] if arguments is None else arguments)
    options = _parser().parse_args(own)
    stop = StopSignal()
    try:
        mission = load_mission(options.mission, options.set) if options.mission else None
    except MissionError as error:
        print(f"recorder: {error}", file=sys.stderr)
        return 2
    folder = Path(options.output) if options.output else fresh_folder(mission.name if mission else "recording")
    # Signals are handled here: rclpy would shut its context down with messages still waiting to be taken.
    rclpy.init(args=["recorder", *for_ros], signal_handler_options=SignalHandlerOptions.NO)
    try:
        return _record(options, mission, folder, stop)
    except BagError as error:
        print(f"recorder: {error}", file=sys.stderr)
        return 1
    finally:
        rclpy.try_shutdown()


def _record(options: argparse.Namespace, mission: Mission | None, folder: Path, stop: StopSignal) -> int:
    everything = options.all or not (options.mission or options.topic)
    node = RecorderNode(
        mission,
        folder,
        options.topic,
        everything=everything,
        overwrite=options.overwrite,
        in_flight=options.in_flight,
    )
    executor = create_executor()
    executor.add_node(node)
    try:
        node.get_logger().info(f"recording into {folder}")
        spin_until(executor, lambda: stop.came or bool(node.failure))
        _drain(executor, node)
    finally:
        node.close(_notes(options.notes, node))
        print(_summary(node, folder), flush=True)
        if options.summary:
            Path(options.summary).write_text(json.dumps(_figures(node)), encoding="utf-8")
        retire(executor, node)
    return 1 if node.failure else 0


def _drain(executor: Executor, node: RecorderNode) -> None:
    """Takes what was published before the signal and is still on its way."""
    limit = time.monotonic() + _DRAIN_LIMIT_S
    before = -1
    while before != node.message_count and time.monotonic() < limit:
        before = node.message_count
        quiet = time.monotonic() + _QUIET_S
        while time.monotonic() < quiet:
            executor.spin_once(timeout_sec=_QUIET_S / 10)


def _notes(file: str | None, node: RecorderNode) -> dict[str, str]:
    """What the flight was like, as its supervisor left it, and what the recorder itself lacks."""
    lines = node.faults()
    if file is not None:
        with suppress(OSError):  # a supervisor that died leaves none
            lines = [*json.loads(Path(file).read_text(encoding="utf-8")), *lines]
    return {INCIDENTS: "\n".join(lines) or "none"}


def _figures(node: RecorderNode) -> dict[str, Any]:
    return {
        "recorded": node.counts,
        "counters": node.counters,
        "faults": node.faults(),
        "failure": node.failure,
        "cpu_s": time.process_time(),
    }


def _summary(node: RecorderNode, folder: Path) -> str:
    lines = [f"{folder}: {node.message_count} messages"]
    lines += [f"  {count:9d}  {topic}" for topic, count in node.counts.items() if count]
    lines += [f"{name}: {count}" for name, count in node.counters.items() if count]
    return "\n".join(lines)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser("recorder", description=_DESCRIPTION, epilog=_EPILOG)
    parser.add_argument("--mission", metavar="NAME|FILE", help="record every topic that its graph publishes")
    parser.add_argument(
        "--in-flight", action="store_true", help="the mission is being flown and waits for this recorder"
    )
    parser.add_argument("--set", metavar="KEY=VALUE", action="append", default=[], help="override a mission value")
    parser.add_argument("--topic", action="append", default=[], help="record this topic; may be repeated")
    parser.add_argument("--all", action="store_true", help="record every topic that appears (default without others)")
    parser.add_argument("-o", "--output", metavar="FOLDER", help="default: bags/NAME_TIME in the project")
    parser.add_argument("--overwrite", action="store_true", help="replace a recording that is there")
    parser.add_argument("--notes", metavar="FILE", help="JSON list of lines to keep in the recording, read at its end")
    parser.add_argument("--summary", metavar="FILE", help="leave the figures of the recording in a JSON file")
    return parser


if __name__ == "__main__":
    sys.exit(main())
