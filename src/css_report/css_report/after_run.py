# SPDX-License-Identifier: Apache-2.0
"""The page that flights, replays and studies end with."""

from collections.abc import Callable
from pathlib import Path

from css_common.command import complain
from css_report.blocks import Page
from css_report.errors import ReportError
from css_report.page_file import write_html


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
