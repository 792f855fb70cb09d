# SPDX-License-Identifier: Apache-2.0
"""Reads a table of telemetry, writes the recording, and says what it is made of."""

import argparse
from collections.abc import Iterator
from pathlib import Path

from css_common.command import FAILED, USAGE, CommandParser, complain
from css_common.epochs import parse_utc
from css_recording.bag_folder import fresh_folder
from css_telemetry.csv_import import ImportReport, import_telemetry, refuse_unscaled
from css_recording.errors import BagError
from css_telemetry.layout_file import read_layout
from css_telemetry.table_columns import likenesses
from css_telemetry.telemetry_table import read_telemetry


def run(parser: CommandParser, options: argparse.Namespace) -> int:
    """Imports as the options say; the exit code."""
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
