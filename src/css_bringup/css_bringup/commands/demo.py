# SPDX-License-Identifier: Apache-2.0
"""Flies one orbit from a tumble, records it, replays it through every Sun estimator and draws what happened.

A spacecraft with eight coarse sun sensors tumbles at up to 2 deg/s about each axis. The Kalman filter finds the Sun
with help of a gyro, four reaction wheels turn the solar arrays to it, the recording is then stepped through weighted
average and Kalman filter, each with gyro and without.
"""

from pathlib import Path

from css_bringup.options import add_domain_option, add_mission_options, add_output_options, guarded
from css_common.command import CommandParser, command_parser, implementation
from css_report.page_option import add_page_option

_EXAMPLES = ("", "okeefe_2013 --duration 600 --out bags/first", "okeefe_2013 --case 7 --figures figures")
_EXITS = {0: "flown, and all pass criteria of the mission met", 1: "the flight failed or missed a criterion"}


def _parser() -> CommandParser:
    parser = command_parser("css_bringup", "demo", __doc__, _EXAMPLES, _EXITS)
    add_mission_options(parser)
    add_domain_option(parser)
    add_output_options(parser)
    parser.add_argument("--figures", type=Path, metavar="DIR", help="where figures go (default: beside the recording)")
    add_page_option(parser)
    return parser


def main(args: list[str] | None = None) -> int:
    """Entry point."""
    parser = _parser()
    arguments = parser.parse_args(args)
    run = implementation("css_bringup.verbs.demo")
    return guarded(parser.prog, lambda: run(arguments))
