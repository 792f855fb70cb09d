# SPDX-License-Identifier: Apache-2.0
"""Turns a table of telemetry into a recording. `import_csv --help` tells how it is used."""

import math
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from css_common.command import FAILED, USAGE, CommandParser, command_parser, complain
from css_common.epochs import parse_utc
from css_recording import layout_file, telemetry_table
from css_recording.bag_folder import fresh_folder
from css_recording.csv_import import ImportReport, import_telemetry, refuse_unscaled
from css_recording.errors import BagError
from css_recording.layout_file import read_layout
from css_recording.table_columns import likenesses
from css_recording.table_values import TIME_UNITS
from css_recording.telemetry_table import read_telemetry

_DESCRIPTION = f"""\
Turn a CSV table of telemetry into a recording that replays like one of Sunpoint's own.

{telemetry_table.__doc__}

The layout file says which columns are cells:

{layout_file.__doc__}
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
    try:
        epoch_ns = None if options.epoch is None else parse_utc(options.epoch)
    except (ValueError, OverflowError) as error:
        parser.error(f"--epoch: {error}")
    source = Path(options.table)
    folder = Path(options.output) if options.output else fresh_folder(source.stem)
    try:
        layout = read_layout(Path(options.layout))
        telemetry = read_telemetry(source, layout, epoch_ns, options.full_scale, options.skip_bad, options.time_unit)
        refuse_unscaled(telemetry, source)
    except BagError as error:
        complain(parser.prog, error)
        return USAGE
    try:
        report = import_telemetry(telemetry, layout, source, folder, overwrite=options.overwrite)
    except BagError as error:
        complain(parser.prog, error)
        return FAILED
    print("\n".join(_summary(report)))
    return 0


def _summary(report: ImportReport) -> Iterator[str]:
    telemetry = report.telemetry
    refused = sum(kind.lines for kind in telemetry.refused.values())
    yield f"{report.recording}: {sum(report.messages.values())} messages, every {report.period_s:g} s"
    yield from (f"  {count:9d}  {topic}" for topic, count in report.messages.items())
    yield f"lines of telemetry: {telemetry.lines} read, {len(telemetry.rows)} used, {refused} refused"
    for kind, found in telemetry.refused.items():
        yield f"  refused ({kind}): {found.lines}, the first is line {found.first_line}"
    counted = {
        "lines used without any cell output": report.missing_lines,
        "lines used without a rate": report.missing_rates,
        "lines used without a Sun vector": report.missing_suns,
        "missing cell outputs in the other lines": report.missing_cells,
    }
    yield from (f"{name}: {count}" for name, count in counted.items() if count)
    for value, count in telemetry.fills.items():
        yield f"taken for a missing value: {value:.10g}, {count} times"
    if report.gaps:
        yield f"gaps in time: {report.gaps}, the longest {report.longest_gap_s:g} s"
    if telemetry.read_as:
        yield f"read as: {', '.join(telemetry.read_as)}"
    if telemetry.has_sun:
        yield "truth: the Sun vector of the table, taken to be in the body frame; position, attitude, eclipse not known"
    if telemetry.ignored_columns:
        yield f"columns not used: {', '.join(telemetry.ignored_columns)}"
        yield from (f"  {likeness}" for likeness in likenesses(telemetry.ignored_columns))
    if not 0.5 <= report.largest_output <= 1.5:
        yield f"the largest cell output is {report.largest_output:.3g}; 1 is the Sun met head-on, see --full-scale"


def _positive(text: str) -> float:
    value = float(text)
    if not 0.0 < value < math.inf:
        raise ValueError
    return value


def _parser() -> CommandParser:
    parser = command_parser("css_recording", "import_csv", _DESCRIPTION, _EXAMPLES, _EXITS, _NOTES)
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
