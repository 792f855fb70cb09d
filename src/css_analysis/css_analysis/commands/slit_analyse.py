# SPDX-License-Identifier: Apache-2.0
"""Sun angle, rotation rate and coning from a file of slit pulses (columns slit and count, and head for several)."""

from collections.abc import Sequence
from pathlib import Path

from css_analysis.slit_file import SlitFileError
from css_common.command import CommandParser, command_parser, guarded, implementation
from css_common.schema import ParameterError

_EXAMPLES = (
    "my_pulses.csv",
    "my_pulses.csv --frequency 1e6 --inertia-ratio 0.7 --figures figures",
    "my_pulses.csv --window 69.2:188 --window 188:300 --passages passages.csv",
)
_EXITS = {
    1: "the pulses make no passage, or the coning period is ambiguous",
    2: "an option or the file is wrong, or a figure cannot be written",
}


def _parser() -> CommandParser:
    parser = command_parser("css_analysis", "slit_analyse", __doc__, _EXAMPLES, _EXITS)
    parser.add_argument("file", type=Path, help="CSV file with the columns slit (upper, vertical, lower) and count")
    parser.add_argument("--frequency", type=float, default=1e6, metavar="HZ", help="of the timer (default: 1e6)")
    parser.add_argument("--inclination-deg", type=float, default=30.0, metavar="DEG", help="of the slanted slits (30)")
    parser.add_argument(
        "--head-azimuths-deg", default="0", metavar="A,B,...", help="places of the heads around the axis (default: 0)"
    )
    parser.add_argument("--inertia-ratio", type=float, default=0.0, metavar="L", help="axial over transverse, if known")
    parser.add_argument("--jitter-us", type=float, default=0.0, metavar="US", help="1 sigma of the delay of a pulse")
    parser.add_argument(
        "--window", action="append", default=[], metavar="START:END",
        help="time of steady motion [s of the timer] to look for coning in; may be repeated (default: all of the file)",
    )  # fmt: skip
    parser.add_argument("--figures", type=Path, metavar="DIR", help="write figures as PNG files into this folder")
    parser.add_argument("--passages", type=Path, metavar="FILE", help="write every passage as a line of a CSV file")
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object on the last line")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(arguments)
    run = implementation("css_analysis.verbs.slit_analyse")
    return guarded(parser.prog, lambda: run(parser.prog, options), (SlitFileError, ParameterError, OSError))
