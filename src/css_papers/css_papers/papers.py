# SPDX-License-Identifier: Apache-2.0
"""What a paper's package offers, and which papers there are.

A paper is a package beside this module that has a module `paper` with

    TITLE: str                                        authors, title, place and year
    CASES, QUICK_CASES: int                           flights of each configuration, if other numbers than usual
    reproduce(request: Request) -> list[Row]          writes figures and pages into `request.folder`

Nothing else is edited to add one.
"""

from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from css_common.schema import unknown_name
from css_monte_carlo.study import Progress
from css_papers.errors import ReproductionError
from css_papers.paper_names import paper_names
from css_papers.rows import Row


class Request(NamedTuple):
    """What the user wants."""

    folder: Path  # exists; figures, pages and studies go here
    cases: int  # of each configuration that flies
    quick: bool  # a first look: side studies are left out
    progress: Callable[[str], Progress] | None = None  # what to tell how far the study of a name is


class Paper(NamedTuple):
    """One paper."""

    name: str
    title: str
    reproduce: Callable[[Request], Sequence[Row]]
    cases: int | None = None  # flights of each configuration; None: as many as usual
    quick_cases: int | None = None


def find_paper(name: str) -> Paper:
    """The paper of a name.

    Raises:
        ReproductionError: there is none.
    """
    names = paper_names()
    if name not in names:
        raise ReproductionError(f"paper {unknown_name(name, names)} (papers: {', '.join(names)})")
    module = import_module(f"{__package__}.{name}.paper")
    cases, quick_cases = (getattr(module, usual, None) for usual in ("CASES", "QUICK_CASES"))
    return Paper(name, module.TITLE, module.reproduce, cases, quick_cases)
