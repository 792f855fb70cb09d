# SPDX-License-Identifier: Apache-2.0
"""Reads a table of telemetry, writes the recording, and says what it is made of; or proposes a description."""

import argparse
import json
import sys
from pathlib import Path

from css_common.command import DONE, FAILED, USAGE, CommandParser, complain
from css_common.epochs import parse_utc
from css_common.mission import MissionError
from css_common.progress_lines import still_working
from css_common.whole_files import write_whole
from css_recording.bag_folder import fresh_folder
from css_recording.errors import BagError
from css_telemetry.description_file import read_description
from css_telemetry.importing import ImportReport, examined, record
from css_telemetry.summary import summary_lines, summary_object
from css_telemetry.telemetry import read_telemetry, refuse_unscaled


def run(parser: CommandParser, options: argparse.Namespace) -> int:
    """Imports or describes as the options say; the exit code."""
    if options.describe:
        return _describe(parser, options)
    try:
        epoch_ns = None if options.epoch is None else parse_utc(options.epoch)
    except (ValueError, OverflowError) as error:
        parser.error(f"--epoch: {error}")
    source = Path(options.table)
    folder = Path(options.output) if options.output else fresh_folder(source.stem)
    try:
        with still_working(f"reading {source}"):
            description = read_description(Path(options.layout))
            telemetry = read_telemetry(
                source,
                description,
                epoch_ns=epoch_ns,
                full_scale=options.full_scale,
                time_unit=options.time_unit,
            )
            refuse_unscaled(telemetry, source)
            calibration = None if options.calibration is None else Path(options.calibration)
            report = examined(telemetry, folder, calibration)
    except (BagError, MissionError) as error:
        complain(parser.prog, error)
        return USAGE
    try:
        record(report, source, overwrite=options.overwrite)
    except BagError as error:
        complain(parser.prog, error)
        return FAILED
    print("\n".join(summary_lines(report)))
    if options.json:
        print(json.dumps(summary_object(report)))
    return _verdict(parser, report, options.skip_bad)


def _verdict(parser: CommandParser, report: ImportReport, skip_bad: bool) -> int:
    """Says what was not as it should be; the exit code knows it."""
    account, doubt = report.telemetry.account, report.telemetry.doubt
    wrong = [doubt] if doubt and not skip_bad else []
    if not skip_bad and (account.refused or account.repaired):
        counts = f"{account.refused_lines} lines refused, {account.repaired_values} values left out"
        wrong.append(f"{counts} of {account.lines} lines; --skip-bad takes that as it is")
    if report.sun is not None and report.sun.doubtful:
        wrong.append(
            f"the Sun of the truth is {report.sun.median_deg:.0f} deg (median) beside the one that the cells see: "
            "check the order and direction of the attitude, the frame, the times, the normals"
        )
    for line in wrong:
        complain(parser.prog, line, "not as it should be")
    return FAILED if wrong else DONE


def _describe(parser: CommandParser, options: argparse.Namespace) -> int:
    from css_telemetry.proposal import proposed

    source = Path(options.table)
    try:
        text = proposed(source)
    except BagError as error:
        complain(parser.prog, error)
        return USAGE
    if options.output is None:
        sys.stdout.write(text)
        return DONE
    target = Path(options.output)
    if target.exists() and not options.overwrite:
        complain(parser.prog, f"{target} is there; --overwrite replaces it")
        return USAGE
    try:
        write_whole(target, text)
    except OSError as error:
        complain(parser.prog, f"{target}: cannot be written: {error.strerror}")
        return FAILED
    print(f"{target}: correct what is marked with ?, then: import-csv {source} {target}")
    return DONE
