# SPDX-License-Identifier: Apache-2.0
"""Turns a table of telemetry into a recording. `import_csv --help` tells how it is used."""

import sys
from collections.abc import Sequence
from pathlib import Path

from css_common.command import FAILED, CommandParser, command_parser, complain
from css_common.epochs import parse_utc
from css_recording import cell_layout, telemetry_table
from css_recording.bag_folder import fresh_folder
from css_recording.cell_layout import read_layout
from css_recording.csv_import import ImportReport, import_telemetry
from css_recording.errors import BagError
from css_recording.telemetry_table import read_telemetry

_DESCRIPTION = f"""\
Turn a CSV table of telemetry into a recording that replays like one of Sunpoint's own.

{telemetry_table.__doc__}

The layout file says which columns are cells:

{cell_layout.__doc__}
"""

_NOTES = """\
A missing cell output becomes NaN, a line without any cell output a gap, a missing rate a gyro that does not
measure. With the Sun vector the recording holds `truth`, in which body and inertial frame are the same."""

_EXAMPLES = (
    "docs/samples/my_cells.csv docs/samples/my_layout.yaml -o bags/mine",
    "counts.csv layout.yaml --epoch 2024-03-20T12:00:00Z --full-scale 3000 --skip-bad",
)
_EXITS = {0: "imported", 1: "a file cannot be read or written, or a line is broken"}


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(arguments)
    try:
        epoch_ns = None if options.epoch is None else parse_utc(options.epoch)
    except ValueError as error:
        parser.error(f"--epoch: {error}")
    source = Path(options.table)
    folder = Path(options.output) if options.output else fresh_folder(source.stem)
    try:
        layout = read_layout(Path(options.layout))
        telemetry = read_telemetry(source, layout, epoch_ns, options.full_scale, options.skip_bad)
        report = import_telemetry(telemetry, layout, source, folder, overwrite=options.overwrite)
    except BagError as error:
        complain(parser.prog, error)
        return FAILED
    print(_summary(report))
    return 0


def _summary(report: ImportReport) -> str:
    lines = [f"{report.recording}: {sum(report.messages.values())} messages, every {report.period_s:g} s"]
    lines += [f"  {count:9d}  {topic}" for topic, count in report.messages.items()]
    counted = {
        "gaps in time": report.gaps,
        "missing cell outputs": report.missing_cells,
        "lines without any cell output": report.missing_lines,
        "lines without a rate": report.missing_rates if "/gyro/imu" in report.messages else 0,
        **{f"broken lines left out ({kind})": count for kind, count in report.skipped.items()},
    }
    lines += [f"{name}: {count}" for name, count in counted.items() if count]
    if report.ignored_columns:
        lines.append(f"columns not used: {', '.join(report.ignored_columns)}")
    if report.largest_output > 1.5:
        lines.append(
            f"the largest cell output is {report.largest_output:.3g}; 1 is the Sun met head-on, see --full-scale"
        )
    return "\n".join(lines)


def _positive(text: str) -> float:
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise ValueError
    return value


def _parser() -> CommandParser:
    parser = command_parser("css_recording", "import_csv", _DESCRIPTION, _EXAMPLES, _EXITS, _NOTES)
    parser.add_argument("table", help="CSV file of telemetry")
    parser.add_argument("layout", help="YAML or CSV file of cell names and normals")
    parser.add_argument("-o", "--output", metavar="FOLDER", help="new recording (default: bags/NAME_TIME)")
    parser.add_argument("--epoch", metavar="UTC", help="instant from which the seconds of the table count")
    parser.add_argument(
        "--full-scale", metavar="V", type=_positive, default=1.0, help="output of a cell that the Sun meets head-on (1)"
    )
    parser.add_argument("--skip-bad", action="store_true", help="leave broken lines out and count them")
    parser.add_argument("--overwrite", action="store_true", help="replace a recording that is there")
    return parser


if __name__ == "__main__":
    sys.exit(main())
