# SPDX-License-Identifier: Apache-2.0
"""Turns a table of telemetry into a recording. `import_csv --help` tells how it is used."""

import math
import sys
from collections.abc import Sequence

from css_common.command import CommandParser, command_parser, implementation
from css_telemetry.table_forms import LAYOUT_FORM, TELEMETRY_FORM, TIME_UNITS

_DESCRIPTION = f"""\
Turn a CSV table of telemetry into a recording that replays like one of Sunpoint's own.

{TELEMETRY_FORM}

The layout file says which columns are cells:

{LAYOUT_FORM}
"""

_NOTES = """\
A missing cell output becomes NaN, a line without any cell output a gap, a missing rate a gyro that does not
measure. With the Sun vector the recording holds `truth`, in which body and inertial frame are the same, position,
velocity and field are zero, which says that they are not known, and the Sun is in view."""

_EXAMPLES = (
    "docs/samples/my_cells.csv docs/samples/my_layout.yaml -o bags/mine",
    "counts.csv layout.yaml --epoch 2024-03-20T12:00:00Z --full-scale 3000 --skip-bad",
)
_EXITS = {0: "imported", 1: "the recording cannot be written", 2: "a file cannot be read, or a line is broken"}


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(arguments)
    run = implementation("css_telemetry.verbs.import_csv")
    return run(parser, options)


def _positive(text: str) -> float:
    value = float(text)
    if not 0.0 < value < math.inf:
        raise ValueError
    return value


def _parser() -> CommandParser:
    parser = command_parser("css_telemetry", "import_csv", _DESCRIPTION, _EXAMPLES, _EXITS, _NOTES)
    parser.add_argument("table", help="CSV file of telemetry")
    parser.add_argument("layout", help="YAML or CSV file of cell names and normals")
    parser.add_argument("-o", "--output", metavar="FOLDER", help="new recording (default: bags/NAME_TIME)")
    parser.add_argument("--epoch", metavar="UTC", help="instant from which the times of the table count")
    parser.add_argument(
        "--time-unit", choices=tuple(TIME_UNITS), help="of times that are numbers (default: the header's, else s)"
    )
    parser.add_argument(
        "--full-scale",
        metavar="V",
        type=_positive,
        help="what the Sun, met head-on, adds to a cell's dark level (default: the layout's, else 1)",
    )
    parser.add_argument("--skip-bad", action="store_true", help="leave broken lines out and count them")
    parser.add_argument("--overwrite", action="store_true", help="replace a recording that is there")
    return parser


if __name__ == "__main__":
    sys.exit(main())
