# SPDX-License-Identifier: Apache-2.0
"""Builds the site, and says where it is."""

import argparse
import json
import sys
import webbrowser

from css_common import places
from css_common.command import FAILED, complain
from css_common.progress_lines import still_working
from css_docs.errors import DocsError


def run(options: argparse.Namespace) -> int:
    """Builds what the options ask for; the exit code.

    Raises:
        DocsError: this is no checkout, what builds sites is not installed, or a page does not fit the code.
    """
    root = places.home().absolute()
    if not (root / "docs" / "conf.py").is_file():
        raise DocsError(f"{root}: has no docs/conf.py, expected the folder of a checkout ({places.HOME})")
    try:
        from css_docs.site import Wish, build_site
    except ModuleNotFoundError as error:
        raise DocsError(f"{error.name} is not installed; ./sunpoint docs installs what it needs") from error
    output = (options.output or places.results("site")).absolute()
    if output.is_file():
        raise DocsError(f"{output}: is a file, expected a folder")
    wish = Wish(output, figures=options.figures and not options.check, fresh=options.fresh, check=options.check)
    with still_working("building the site"):
        site = build_site(root, places.scratch("docs"), wish, _tell)
    if options.check:
        print(f"nothing is wrong with {site.pages} pages ({site.seconds:.0f} s)")
        return 0
    print(f"site: {site.file} ({site.pages} pages, {site.figures} figures, {site.seconds:.0f} s)")
    opened = not options.open or webbrowser.open(site.file.as_uri())
    if not opened:
        complain("docs", "no browser could be started; open the page yourself")
    if options.json:
        told = {
            "index": str(site.file),
            "pages": site.pages,
            "figures": site.figures,
            "seconds": round(site.seconds, 1),
        }
        print(json.dumps(told))
    return 0 if opened else FAILED


def _tell(line: str) -> None:
    print(f"docs: {line}", file=sys.stderr, flush=True)
