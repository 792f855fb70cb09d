# SPDX-License-Identifier: Apache-2.0
"""Player process: `player --help` tells how it is used."""

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path

from css_common.command import CommandParser, command_parser, implementation, number, positive
from css_common.stop_signal import StopSignal
from css_recording.ros_arguments import split_arguments

_DESCRIPTION = """\
Publish a recording, or several merged by time, to live nodes. Topics that a live node publishes are left to it.
With --wait-for the playback is in lockstep: the next stamp follows when all these topics have answered the last."""

_NOTES = """\
keys, on a terminal: SPACE hold or go on; RIGHT next message, S next stamp, while held; UP and DOWN rate +10 and -10 %.
services: ~/pause ~/resume ~/toggle_paused ~/is_paused ~/play_next ~/play_next_stamp ~/get_rate ~/seek, of the types of
  rosbag2_interfaces where that is installed, then also ~/set_rate; else std_srvs/srv/Trigger, whose text answers, and
  css_msgs/srv/Seek.
parameter: rate, at any time: ros2 param set /player rate 2.0
  The node is /player; --ros-args -r __node:=rosbag2_player gives the services the full names that rosbag2 has."""

_EXAMPLES = (
    "bags/FLIGHT",
    "bags/FLIGHT --rate 10 --start 100 --end 200 --clock",
    "bags/FLIGHT --topic css/voltages --topic gyro/imu --wait-for ekf/sun_estimate",
    "bags/FLIGHT bags/OTHER --start-paused --qos-profile-overrides-path qos.yaml",
)
_EXITS = {
    0: "played, or stopped by a signal",
    1: "a node does not answer, or nothing is left to play",
    2: "a recording or an option is wrong",
}

_seconds = number("seconds from 0 on", lambda value: 0.0 <= value < math.inf)
_rate = number("a number above 0, or inf", lambda value: value > 0.0)


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    own, for_ros = split_arguments(sys.argv[1:] if arguments is None else arguments)
    parser = _parser()
    options = parser.parse_args(own)
    if options.end is not None and options.end <= options.start:
        parser.error(f"--end {options.end:g}: expected more than the start, {options.start:g} s")
    run = implementation("css_recording.verbs.play")
    return run(parser, options, for_ros, StopSignal())


def _renaming(text: str) -> tuple[str, str]:
    old, separator, new = text.partition(":=")
    if not (old and separator and new):
        raise argparse.ArgumentTypeError(f"{text} given, expected OLD:=NEW")
    return old, new


def _parser() -> CommandParser:
    parser = command_parser("css_recording", "player", _DESCRIPTION, _EXAMPLES, _EXITS, _NOTES)
    add = parser.add_argument
    add("recording", nargs="+", type=Path, help="folder of a recording, or its .mcap file; several are merged by time")
    add("--rate", type=_rate, help="recorded seconds per second, inf for no limit (default: 1; lockstep: inf)")
    add("--start-paused", action="store_true", help="begin held: SPACE or ~/resume lets it go")
    add("--start", metavar="S", type=_seconds, default=0.0, help="begin S seconds into the recording (default: 0)")
    add("--end", metavar="S", type=_seconds, help="end S seconds into the recording (default: with its last message)")
    add("--topic", action="append", default=[], help="play this topic only; may be repeated (default: all)")
    add("--remap", metavar="OLD:=NEW", type=_renaming, action="append", default=[], help="rename a recorded topic")
    add("--loop", action="store_true", help="begin again at the end, with the same stamps")
    add("--stay", action="store_true", help="wait at the end until ~/seek goes elsewhere, or Ctrl-C")
    add("--clock", action="store_true", help="publish the recorded time on /clock")
    add("--wait-for", metavar="TOPIC", action="append", default=[], help="lockstep with this topic; may be repeated")
    add("--pace", metavar="TOPIC", help="answers are due to stamps of this topic (default: busiest)")
    add("--patience", metavar="S", type=positive, default=30.0, help="wall time for an answer [s] (default: 30)")
    add(
        "--qos-profile-overrides-path", metavar="FILE", type=Path,
        help="quality of service of topics, in rosbag2's YAML (default: reliable, transient local, depth 100)",
    )  # fmt: skip
    add("--json", action="store_true", help="print the result as one JSON object on the last line")
    return parser
