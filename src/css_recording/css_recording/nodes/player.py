# SPDX-License-Identifier: Apache-2.0
"""Player process: `player --help` tells how it is used."""

import argparse
import sys
from collections.abc import Sequence

import rclpy
from rclpy.signals import SignalHandlerOptions

from css_common.executor import create_executor
from css_common.stop_signal import StopSignal
from css_recording.bag_reader import BagReader
from css_recording.errors import BagError
from css_recording.playback import PlaybackError, PlaybackOptions, PlaybackReport
from css_recording.player import PlayerNode
from css_recording.process import split_arguments

_DESCRIPTION = """\
Publish a recording to live nodes. Topics that a live node publishes are left to it. With --wait-for the playback is
in lockstep: the next stamp follows when all these topics have answered the last one."""

_EPILOG = """\
Exit code: 0 played or stopped by a signal, 1 the recording cannot be read or a node does not answer, 2 wrong usage."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    own, for_ros = split_arguments(sys.argv[1:] if arguments is None else arguments)
    parser = _parser()
    options = parser.parse_args(own)
    try:
        remap = dict(_renaming(text) for text in options.remap)
    except ValueError as error:
        parser.error(str(error))
    stop = StopSignal()
    rclpy.init(args=["player", *for_ros], signal_handler_options=SignalHandlerOptions.NO)
    try:
        with BagReader(options.recording, remap) as reader:
            print(_summary(_play(reader, options, stop)))
        return 0
    except (BagError, PlaybackError) as error:
        print(f"player: {error}", file=sys.stderr)
        return 1
    finally:
        rclpy.try_shutdown()


def _play(reader: BagReader, options: argparse.Namespace, stop: StopSignal) -> PlaybackReport:
    playback = PlaybackOptions(
        rate=float("inf") if options.rate is None and options.wait_for else options.rate or 1.0,
        wait_for=tuple(options.wait_for),
        pace=options.pace,
        patience=options.patience,
        clock=options.clock,
        start=options.start,
        end=options.end,
        topics=tuple(options.topic) or None,
    )
    node = PlayerNode(reader, playback)
    executor = create_executor()
    executor.add_node(node)
    try:
        report = node.play(executor, lambda: stop.came)
        while options.loop and report.stamps and not stop.came:
            report = node.play(executor, lambda: stop.came)
        return report
    finally:
        executor.remove_node(node)
        node.destroy_node()


def _summary(report: PlaybackReport) -> str:
    lines = [f"{sum(report.published.values())} messages of {report.stamps} stamps published"]
    lines += [f"  {count:9d}  {topic}" for topic, count in report.published.items()]
    lines += [f"left to live nodes: {topic}" for topic in report.left_to_live_nodes]
    lines += [f"type not installed: {topic}" for topic in report.not_installed]
    return "\n".join(lines)


def _renaming(text: str) -> tuple[str, str]:
    old, separator, new = text.partition(":=")
    if not (old and separator and new):
        raise ValueError(f"--remap {text}: expected OLD:=NEW")
    return old, new


def _positive(text: str) -> float:
    value = float(text)
    if not value > 0.0:
        raise ValueError
    return value


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser("player", description=_DESCRIPTION, epilog=_EPILOG)
    parser.add_argument("recording", help="folder of the recording, or its .mcap file")
    parser.add_argument(
        "--rate", type=_positive, help="recorded seconds per second, 'inf' for no limit (default: 1; lockstep: inf)"
    )
    parser.add_argument(
        "--wait-for", metavar="TOPIC", action="append", default=[], help="lockstep with this topic; may be repeated"
    )
    parser.add_argument("--pace", metavar="TOPIC", help="answers are due to stamps of this topic (default: busiest)")
    parser.add_argument(
        "--patience", metavar="S", type=_positive, default=30.0, help="wall time allowed for an answer [s] (30)"
    )
    parser.add_argument("--topic", action="append", default=[], help="play this topic only; may be repeated")
    parser.add_argument("--remap", metavar="OLD:=NEW", action="append", default=[], help="rename a recorded topic")
    parser.add_argument("--start", metavar="S", type=float, default=0.0, help="begin S seconds into the recording")
    parser.add_argument("--end", metavar="S", type=float, help="end S seconds into the recording")
    parser.add_argument("--loop", action="store_true", help="begin again at the end, with the same stamps")
    parser.add_argument("--clock", action="store_true", help="publish the recorded time on /clock")
    return parser


if __name__ == "__main__":
    sys.exit(main())
