# SPDX-License-Identifier: Apache-2.0
"""Writing a page, and what is said of it."""

from pathlib import Path
from typing import Any, NamedTuple

from css_common.whole_files import write_whole
from css_report.blocks import Page
from css_report.errors import ReportError
from css_report.html_page import anchor, html_of


class PageFile(NamedTuple):
    """A page that was written."""

    file: Path
    size: int  # [bytes]
    sections: list[str]

    def as_object(self) -> dict[str, Any]:
        """What `--json` says."""
        return {"file": str(self.file), "bytes": self.size, "sections": self.sections}


def write_html(page: Page, file: Path) -> PageFile:
    """Writes a page, whole or not at all.

    Raises:
        ReportError: the file cannot be written.
    """
    data = html_of(page).encode("utf-8", "replace")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(file, data)
    except OSError as error:
        raise ReportError(f"{file}: the page cannot be written: {error.strerror}") from error
    return PageFile(file, len(data), [anchor(section.title) for section in page.sections])
