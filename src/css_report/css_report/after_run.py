# SPDX-License-Identifier: Apache-2.0
"""The page that flights, replays and studies end with."""

import argparse
from collections.abc import Callable
from pathlib import Path

from css_common.command import complain
from css_report.blocks import Page
from css_report.page_file import ReportError, write_html


def add_page_option(parser: argparse.ArgumentParser) -> None:
    """Whether a run ends with a page."""
    parser.add_argument("--no-report", action="store_false", dest="report", help="end without writing a page")


def write_page_after(prog: str, page: Callable[[], Page], file: Path) -> Path | None:
    """Writes the page of a run and names it; one that cannot be written is said, and None.

    Args:
        prog: name of the command, for the complaint.
        page: makes it.
        file: where it goes.
    """
    try:
        written = write_html(page(), file)
    except ReportError as error:
        complain(prog, error)
        return None
    print(f"page: {written.file}", flush=True)
    return written.file
