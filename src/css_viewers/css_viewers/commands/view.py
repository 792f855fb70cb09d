# SPDX-License-Identifier: Apache-2.0
"""Makes a recording that viewers draw in 3-D: the recording itself with markers, pose and transforms added.

Foxglove, Lichtblick, RViz and PlotJuggler read it; layouts for them lie in config/viewers. With --rerun it becomes one
file for the Rerun viewer instead. To see a flight while it flies, add css_viewers/visualizer to graph.nodes of the
mission, or start it beside: ros2 run css_viewers visualizer --ros-args --params-file config/okeefe_2013.yaml
"""

from collections.abc import Sequence
from pathlib import Path

from css_common.command import CommandParser, command_parser, guarded, implementation
from css_common.mission_file import MissionError
from css_recording.errors import BagError
from css_viewers.errors import ViewerError

_EXAMPLES = ("bags/reference -o /tmp/reference_viewers", "bags/FLIGHT --every 10", "bags/FLIGHT --rerun flight.rrd")
_EXITS = {0: "it is written", 1: "it is written, and messages of the recording were refused"}
_MOST = 100_000


def _parser() -> CommandParser:
    parser = command_parser("css_viewers", "view", __doc__, _EXAMPLES, _EXITS)
    add = parser.add_argument
    add("bag", type=Path, metavar="BAG", help="recording (folder or .mcap file)")
    add("-o", "--output", type=Path, metavar="FOLDER", help="recording to write (default: BAG_viewers)")
    add("--rerun", type=Path, metavar="FILE", help="write a file for Rerun instead (needs requirements-rerun.lock)")
    add("--every", type=int, default=5, metavar="N", help="draw every so many control cycles (default: 5)")
    add("--mission", metavar="MISSION", help="spacecraft to draw, for a recording without a mission")
    add("--overwrite", action="store_true", help="replace a recording that is there")
    add("--json", action="store_true", help="end with {file, messages, seconds, refused, notes} as one JSON object")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(arguments)
    if not 1 <= options.every <= _MOST:
        parser.error(f"--every: {options.every} given, expected 1 to {_MOST}")
    if options.rerun is not None and options.output is not None:
        parser.error("-o and --rerun: expected one of them")
    run = implementation("css_viewers.verbs.view")
    return guarded(parser.prog, lambda: run(options), (ViewerError, BagError, MissionError))
