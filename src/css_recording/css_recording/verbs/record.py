# SPDX-License-Identifier: Apache-2.0
"""Records until it is told to end, and says what is in the recording."""

import argparse
import json
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from rclpy.executors import Executor

from css_common.command import FAILED, CommandParser, complain, guarded
from css_common.executor import executor_with, spin_until
from css_common.mission import load_mission
from css_common.mission_file import MissionError
from css_common.stop_signal import StopSignal
from css_recording.bag_folder import fresh_folder
from css_recording.bag_metadata import absolute
from css_recording.errors import BagError
from css_recording.process import RosArgumentsError, ros_process
from css_recording.qos_overrides import read_qos_overrides
from css_recording.recorder import RecorderNode
from css_recording.recording_choice import Excluded, RecordingChoice
from css_recording.split_bag_writer import FileLimits

_QUIET_S = 0.5  # a loaded machine delivers late what was published before the signal
_DRAIN_LIMIT_S = 5.0


def run(parser: CommandParser, options: argparse.Namespace, for_ros: Sequence[str], stop: StopSignal) -> int:
    """Records as the options say; the exit code."""
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
    with executor_with(node) as executor:
        try:
            node.get_logger().info(f"recording into {folder}")
            spin_until(executor, lambda: stop.came or bool(node.failure))
            _drain(executor, node)
        finally:
            node.close(_incidents(options.notes))
            missing = _say(parser, options, node, folder)
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
