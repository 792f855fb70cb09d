# SPDX-License-Identifier: Apache-2.0
"""Plays a recording to live nodes, and says what was played."""

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict

from css_common.command import CommandParser, complain, guarded
from css_common.executor import executor_with
from css_common.stop_signal import StopSignal
from css_recording.errors import BagError
from css_recording.merged_bags import MergedBags
from css_recording.playback import PlaybackError, PlaybackOptions, PlaybackReport
from css_recording.player import PlayerNode
from css_recording.process import RosArgumentsError, ros_process
from css_recording.qos_overrides import read_qos_overrides
from css_recording.terminal_keys import TerminalKeys


def run(parser: CommandParser, options: argparse.Namespace, for_ros: Sequence[str], stop: StopSignal) -> int:
    """Plays as the options say; the exit code."""
    wrong = (BagError, RosArgumentsError)
    return guarded(parser.prog, lambda: _run(parser, options, for_ros, stop), wrong, (PlaybackError,))


def _run(parser: CommandParser, options: argparse.Namespace, for_ros: Sequence[str], stop: StopSignal) -> int:
    playback = _playback(options)
    with MergedBags(options.recording, dict(options.remap)) as recording:
        _name_unused_overrides(parser, playback, recording)
        with ros_process("player", for_ros):
            report = _play(recording, playback, stop)
        notes = recording.notes
    print(_summary(report))
    for note in notes:
        complain(parser.prog, note, "note")
    if options.json:
        print(json.dumps(asdict(report) | {"notes": notes}))
    return 0


def _playback(options: argparse.Namespace) -> PlaybackOptions:
    return PlaybackOptions(
        rate=float("inf") if options.rate is None and options.wait_for else options.rate or 1.0,
        wait_for=tuple(options.wait_for),
        pace=options.pace,
        patience=options.patience,
        clock=options.clock,
        start=options.start,
        end=options.end,
        topics=tuple(options.topic) or None,
        paused=options.start_paused,
        loop=options.loop,
        stay=options.stay,
        qos=read_qos_overrides(options.qos_profile_overrides_path),
    )


def _name_unused_overrides(parser: CommandParser, playback: PlaybackOptions, recording: MergedBags) -> None:
    unused = playback.qos.keys() - {entry.topic.name for entry in recording.topics}
    if unused:
        where = "is for a topic that the recording does not hold"
        complain(parser.prog, f"quality of service of {', '.join(sorted(unused))} {where}", "warning")


def _play(recording: MergedBags, playback: PlaybackOptions, stop: StopSignal) -> PlaybackReport:
    node = PlayerNode(recording, playback)
    with executor_with(node) as executor, TerminalKeys() as keys:
        return node.play(executor, lambda: stop.came, lambda: _obey(node, keys))


def _obey(node: PlayerNode, keys: TerminalKeys) -> None:
    for key in keys.read():
        node.controls.press(key)


def _summary(report: PlaybackReport) -> str:
    lines = [f"{sum(report.published.values())} messages of {report.stamps} stamps published"]
    lines += [f"  {count:9d}  {topic}" for topic, count in report.published.items()]
    lines += [f"left to live nodes: {topic}" for topic in report.left_to_live_nodes]
    lines += [f"type not installed: {topic}" for topic in report.not_installed]
    return "\n".join(lines)
