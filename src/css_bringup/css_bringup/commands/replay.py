# SPDX-License-Identifier: Apache-2.0
"""Steps estimators over a recording, without topics or clock, and compares what they make of it.

The recording may be Sunpoint's own or any rosbag2 recording (mcap or sqlite3) of the same message types. An estimator
is NAME or NAME:KEY=VALUE,..., for instance ekf:gyro=off or wavg:gate=0.4. The estimator that flew, replayed with the
parameters it had, gives the bytes that flew; the result says so.

What the mission scripted and what was set in flight happens to the estimators that it was addressed to, as in flight.
A value that is asked for here (NAME:KEY=VALUE, --set) stays.
"""

from pathlib import Path

from css_bringup.options import guarded
from css_common.command import CommandParser, command_parser, implementation
from css_report.page_option import add_page_option

_EXAMPLES = (
    "bags/FLIGHT",
    "bags/FLIGHT --estimators wavg:gate=0.3 ekf:gyro=off --figures figures",
    "bags/FOREIGN --mission okeefe_2013 --remap /sensors/css:=/css/voltages",
)
_EXITS = {
    0: "each estimator gave estimates; one that flew gave the bytes that flew (values within 1e-6 on another machine)",
    1: "an estimator gave nothing, or its estimates differ from the flight or could not be compared with it",
}


def _parser() -> CommandParser:
    parser = command_parser("css_bringup", "replay", __doc__, _EXAMPLES, _EXITS)
    parser.add_argument("bag", type=Path, help="recording: a rosbag2 folder or an .mcap file")
    parser.add_argument(
        "--estimators", nargs="+", default=["wavg", "wavg:gyro=off", "ekf", "ekf:gyro=off"], metavar="NAME[:KEY=VALUE]",
        help="what to step over it (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument("--mission", metavar="NAME", help="parameters from this mission, not from the recording's own")
    parser.add_argument(
        "--calibration", type=Path, metavar="FILE", help="what `calibrate` found of the sensors, on top of the mission"
    )
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides", help="change one parameter"
    )
    parser.add_argument(
        "--remap", nargs="+", default=[], metavar="OLD:=NEW", help="topics of the recording under the graph's names"
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="new recording (default: BAG_replay, or _replay_2 ...)")
    parser.add_argument("--overwrite", action="store_true", help="replace a recording that is there")
    parser.add_argument("--figures", type=Path, metavar="DIR", help="write figures of the comparison as PNG")
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object on the last line")
    add_page_option(parser)
    return parser


def main(args: list[str] | None = None) -> int:
    """Entry point; exit codes are in the description of the command."""
    parser = _parser()
    arguments = parser.parse_args(args)
    run = implementation("css_bringup.verbs.replay")
    return guarded(parser.prog, lambda: run(arguments))
