# SPDX-License-Identifier: Apache-2.0
"""Lays the site out and has Sphinx build it."""

import io
import shutil
import sys
import time
from collections.abc import Callable
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from sphinx.application import Sphinx
from sphinx.errors import SphinxError
from sphinx.util.console import nocolor
from sphinx.util.docutils import docutils_namespace, patch_docutils

from css_docs.algorithm_pages import additions
from css_docs.errors import BrokenPages
from css_docs.figure_files import FIGURES, drawn_figures
from css_docs.made_pages import made_pages
from css_docs.staging import Stage

INDEX = "index.html"


class Site(NamedTuple):
    """What was built."""

    file: Path  # to begin with
    pages: int
    figures: int
    seconds: float


class Wish(NamedTuple):
    """What to build.

    Attributes:
        output: folder of the site.
        figures: with the figures of algorithm pages.
        fresh: read all pages anew.
        check: read all pages and resolve what they link, and write nothing.
    """

    output: Path
    figures: bool = True
    fresh: bool = False
    check: bool = False


def build_site(root: Path, work: Path, wish: Wish, tell: Callable[[str], None]) -> Site:
    """Builds the site.

    Args:
        root: the repository.
        work: folder for what can be made again.
        wish: what to build.
        tell: takes a line when something that takes time begins.

    Raises:
        BrokenPages: Sphinx warned of something; its warnings are on standard error.
        DocsError: a link or a page does not fit the code.
    """
    began = time.monotonic()
    kind = "check" if wish.check else "site"
    source, doctrees = work / kind / "source", work / kind / "doctrees"
    tell("making the reference")
    stage = Stage(root, source, show_sources=not wish.check)
    drawn = drawn_figures(root, work / FIGURES, tell) if wish.figures else {}
    for name, file in drawn.items():
        stage.copy(file, PurePosixPath(FIGURES, f"{name}.svg"))
    for file in sorted((root / "docs" / "_static").iterdir()):
        stage.copy(file, PurePosixPath("_static", file.name))
    stage.copy(root / "docs" / "conf.py", PurePosixPath("conf.py"))
    stage.lay_out(made_pages(root), additions(root, drawn.keys()))
    tell(f"building {stage.pages} pages")
    if wish.fresh:
        shutil.rmtree(doctrees, ignore_errors=True)
    _run_sphinx(source, wish, doctrees)
    return Site(wish.output / INDEX, stage.pages, len(drawn), time.monotonic() - began)


def _run_sphinx(source: Path, wish: Wish, doctrees: Path) -> None:
    warnings = io.StringIO()
    nocolor()
    try:
        with patch_docutils(str(source)), docutils_namespace():
            app = Sphinx(
                srcdir=source, confdir=source, outdir=doctrees if wish.check else wish.output, doctreedir=doctrees,
                buildername="dummy" if wish.check else "html", status=None, warning=warnings, freshenv=wish.fresh,
                warningiserror=True,
            )  # fmt: skip
            app.build()
            failed = app.statuscode != 0
    except SphinxError as error:
        print(error, file=sys.stderr)
        failed = True
    told = warnings.getvalue().replace(f"{source}/", "").strip()
    if failed or told:
        # what Sphinx has read it would not warn of again
        shutil.rmtree(doctrees, ignore_errors=True)
        print(told, file=sys.stderr)
        raise BrokenPages(f"{len(told.splitlines()) or 1} warnings of pages, listed above; paths are those of the site")
