# SPDX-License-Identifier: Apache-2.0
"""Builds the documentation as a site of plain files that needs no network, its search neither.

Reference, algorithm sections and figures are made from the code; a link that leads nowhere, an equation that cannot be
set or any other warning fails the build. Figures are drawn anew when the code that they are drawn by changes.
"""

from collections.abc import Sequence
from pathlib import Path

from css_common.command import CommandParser, command_parser, guarded, implementation
from css_common.mission_file import MissionError
from css_docs.errors import BrokenPages, DocsError

_EXAMPLES = ("", "--open", "-o /tmp/site --json", "--check")
_EXITS = {1: "a page is wrong, or no browser could be started"}


def _parser() -> CommandParser:
    parser = command_parser("css_docs", "docs", __doc__, _EXAMPLES, _EXITS)
    add = parser.add_argument
    add("-o", "--output", type=Path, metavar="DIR", help="folder of the site (default: site/ in the project)")
    add("--open", action="store_true", help="open it in the browser")
    add(
        "--no-figures", action="store_false", dest="figures",
        help="leave out the figures of algorithm pages, which take longest; their places say so",
    )  # fmt: skip
    add("--check", action="store_true", help="find what is wrong with the pages, and write no site")
    add("--fresh", action="store_true", help="read every page anew, whatever an earlier build left")
    add(
        "--json", action="store_true", help="print {index, pages, figures, seconds} as one JSON object on the last line"
    )
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(arguments)
    run = implementation("css_docs.verbs.docs")
    return guarded(parser.prog, lambda: run(options), (DocsError, MissionError, OSError), (BrokenPages,))
