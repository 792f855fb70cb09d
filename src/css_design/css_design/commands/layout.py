# SPDX-License-Identifier: Apache-2.0
"""Searches where the cells of a mission should look: a front of heading error against number of cells.

A layout is judged with the Sun over the sphere and near the normal of the arrays, under the light of the Earth at
sunlit places of the orbit, by the error that one estimate from its readings has, with all cells and with each one dead.
Every number of cells is written as a mission that flies.
"""

import signal
from collections.abc import Sequence
from pathlib import Path

from css_common.command import MISSION_HELP, CommandParser, command_parser, guarded, implementation, number, positive
from css_common.mission_file import MissionError
from css_design.errors import DesignError

_EXAMPLES = (
    "okeefe_2013",
    "okeefe_2013 --cells 4-10 --out layouts",
    "cubesat_3u_safe --faces +x -x +y -y --tilt 20 --cells 6-8 --json",
    "okeefe_2013 --cells 8 --pointing 0 --weights 1,0,0",
    "okeefe_2013 --cells 8 --pointing 0.8 --weights 1,0,0.5,0.5",
    "okeefe_2013 --cells 8 --flights 48",
    "cubesat_3u_safe --structure docs/samples/cubesat_boxes.yaml --views 90 120",
)
_NOTES = """\
Errors are root mean squares over the two axes of the heading. mean: over the scenes; worst: of all; failed: the mean
with the one cell dead whose loss costs most; worst 5 %: the mean of the worst scenes that have a twentieth of the
weight. A search makes A mean + B worst + C failed + D worst 5 % small (--weights A,B,C,D).
Ctrl-C ends it with the best so far."""


def _parser() -> CommandParser:
    parser = command_parser("css_design", "layout", __doc__, _EXAMPLES, {1: "a layout does not fly"}, notes=_NOTES)
    add = parser.add_argument
    share = number("a share from 0 to 1", lambda value: 0.0 <= value <= 1.0)
    tilt = number("an angle from 0 to 90 deg", lambda value: 0.0 <= value <= 90.0)
    add("mission", nargs="?", default="okeefe_2013", help=MISSION_HELP)
    add("--cells", default="4-10", metavar="N or N-M", help="numbers of cells (default: %(default)s)")
    add(
        "--faces",
        nargs="+",
        default=["+x", "-x", "+y", "-y", "+z", "-z"],
        metavar="FACE",
        help="faces of the body that cells may be on (default: all six)",
    )
    add("--tilt", type=tilt, default=55.0, metavar="DEG", help="largest tilt from a face [deg] (default: %(default)s)")
    add(
        "--pointing",
        type=share,
        default=0.5,
        metavar="SHARE",
        help="weight of Suns within 30 deg of the array normal, the rest over the sphere (default: %(default)s)",
    )
    add(
        "--weights",
        default="1,0.1,0.5",
        metavar="A,B,C[,D]",
        help="weights of mean, worst, failed and worst 5 %% (default: %(default)s)",
    )
    add(
        "--prior",
        type=positive,
        default=20.0,
        metavar="DEG",
        help="what is known before the cells are read, 1 sigma about each axis [deg] (default: %(default)s)",
    )
    add(
        "--views",
        nargs="+",
        type=number("an angle from 10 to 180 deg", lambda value: 10.0 <= value <= 180.0),
        metavar="DEG",
        help="full cones of view that cells may have [deg] (default: those of the mission)",
    )
    add(
        "--structure",
        type=Path,
        metavar="FILE",
        help="what blocks the cells: an STL, OBJ or PLY file in m, or boxes in a YAML file (docs/layout.md)",
    )
    add(
        "--flights",
        type=int,
        metavar="N",
        help="let what the ways of the search end with, the mission's own layout and what lies between fly so many "
        "cases each with the mission's own estimator, and take that with the smallest 95 %% error",
    )
    add("--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides", help="change one parameter")
    add("--out", type=Path, metavar="DIR", help="folder of the missions (default: layouts/MISSION)")
    add("--no-missions", action="store_true", help="write no missions")
    add("--json", action="store_true", help="print the result as one JSON object on the last line")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(arguments)
    # a killed terminal or `kill` end it as Ctrl-C does
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    run = implementation("css_design.verbs.layout")
    return guarded(parser.prog, lambda: run(options), (DesignError, MissionError))
