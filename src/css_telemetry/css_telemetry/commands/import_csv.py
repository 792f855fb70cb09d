# SPDX-License-Identifier: Apache-2.0
"""Turns a table of telemetry into a recording. `import_csv --help` tells how it is used."""

import math
import signal
from collections.abc import Sequence

from css_common.command import CommandParser, command_parser, guarded, implementation, number
from css_telemetry.table_forms import DESCRIPTION_FORM, TELEMETRY_FORM

_UNITS = ("s", "ms", "us", "ns", "min", "h", "d")
_DESCRIPTION = f"""\
Turn a table of telemetry into a recording that replays like one of Sunpoint's own.

{TELEMETRY_FORM}
{DESCRIPTION_FORM}"""

_NOTES = """\
A missing cell output becomes NaN, a line without any cell output a gap, a missing rate a gyro that does not
measure. With the Sun vector alone the recording holds `truth` in which body and inertial frame are the same; what is
not known is zero there and told as unknown. An orbit that nobody gave is none: estimators that need one ask for it."""

_EXAMPLES = (
    "docs/samples/my_cells.csv docs/samples/my_layout.yaml -o bags/mine",
    "docs/samples/my_cells.csv --describe -o mine.yaml",
    "march.csv mine.yaml --calibration my_cells.yaml -o bags/march",
    "counts.csv layout.yaml --epoch 2024-03-20T12:00:00Z --full-scale 3000 --skip-bad --json",
)
_EXITS = {
    0: "imported as the table stands",
    1: "what could not be read was left out (--skip-bad: 0), cells contradict the truth, or nothing can be written",
    2: "table, description or options are wrong",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(arguments)
    if options.layout is None and not options.describe:
        parser.error("a description or layout of the cells is missing; --describe proposes one")
    run = implementation("css_telemetry.verbs.import_csv")
    # a killed terminal or `kill` end it as Ctrl-C does
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    return guarded(parser.prog, lambda: run(parser, options), (), interrupted="interrupted; nothing written")


def _parser() -> CommandParser:
    parser = command_parser("css_telemetry", "import_csv", _DESCRIPTION, _EXAMPLES, _EXITS, _NOTES)
    positive = number("a number above 0", lambda value: 0.0 < value < math.inf)
    parser.add_argument("table", help="table of telemetry: text, Parquet or Excel")
    parser.add_argument("layout", nargs="?", metavar="description", help="YAML description, or CSV file of cells")
    parser.add_argument(
        "-o", "--output", metavar="PATH", help="new recording (default: bags/NAME_TIME), or file for --describe"
    )
    parser.add_argument(
        "--describe", action="store_true", help="propose a description of the table, with a reason for each guess"
    )
    parser.add_argument("--epoch", metavar="UTC", help="instant from which the times of the table count")
    parser.add_argument(
        "--time-unit",
        choices=_UNITS,
        help="of times that are numbers (default: the description's, the header's, else s)",
    )
    parser.add_argument(
        "--full-scale",
        metavar="V",
        type=positive,
        help="what the Sun, met head-on, adds to a cell's dark level (default: the description's, else 1)",
    )
    parser.add_argument(
        "--calibration", metavar="FILE", help="what `calibrate` found of these sensors: replays of the recording use it"
    )
    parser.add_argument(
        "--skip-bad", action="store_true", help="lines and values that cannot be read are no reason for exit code 1"
    )
    parser.add_argument("--overwrite", action="store_true", help="replace a recording or description that is there")
    parser.add_argument("--json", action="store_true", help="print the summary as one JSON object on the last line")
    return parser
