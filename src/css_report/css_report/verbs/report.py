# SPDX-License-Identifier: Apache-2.0
"""Writes the page of a recording or a study."""

import argparse
import json
import webbrowser
from pathlib import Path

from css_analysis.study_record import MANIFEST, read_record
from css_common.command import FAILED, complain
from css_common.progress_lines import still_working
from css_report.errors import ReportError
from css_report.flight_page import flight_page, read_for_page
from css_report.page_file import PageFile, write_html
from css_report.places import page_of
from css_report.study_page import study_page


def run(options: argparse.Namespace) -> int:
    """Writes the page that the options ask for; the exit code."""
    subject, against = options.subject, options.against
    if against is not None and is_study(against) != is_study(subject):
        raise ReportError(
            f"--against {against}: expected a {'study' if is_study(subject) else 'recording'}, as {subject} is"
        )
    file = options.output or page_of(subject, against)
    if file.is_dir():
        raise ReportError(f"{file}: is a folder, expected a file to write")
    with still_working(f"writing {file}"):
        written = _write(subject, against, file)
    print(f"page: {written.file} ({written.size / 1e6:.1f} MB)")
    opened = not options.open or webbrowser.open(written.file.absolute().as_uri())
    if not opened:
        complain("report", "no browser could be started; open the page yourself")
    if options.json:
        print(json.dumps(written.as_object(), allow_nan=False))
    return 0 if opened else FAILED


def is_study(path: Path) -> bool:
    """Whether a path is a folder of a study."""
    return (path / MANIFEST).is_file()


def _write(subject: Path, against: Path | None, file: Path) -> PageFile:
    if is_study(subject):
        studies = [read_record(path) for path in (subject, *([against] if against else []))]
        return write_html(study_page(*studies), file)
    flights = [read_for_page(path) for path in (subject, *([against] if against else []))]
    return write_html(flight_page(*flights), file)
