# SPDX-License-Identifier: Apache-2.0
"""Figures of algorithm pages: a module of `figures/` draws each; kept until code that it is drawn by changes."""

import importlib
import pkgutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from css_analysis.figure_style import style
from css_common.kernel_sources import hash_of, sources_of
from css_docs import figures

FIGURES = "figures"
"""Folder of the site that holds them."""


def figure_names() -> list[str]:
    """Every figure: a module of `css_docs.figures`."""
    return sorted(module.name for module in pkgutil.iter_modules(figures.__path__) if not module.name.startswith("_"))


def drawn_figures(root: Path, folder: Path, tell: Callable[[str], None]) -> dict[str, Path]:
    """The files of all figures by name; those whose code has changed are drawn.

    Args:
        root: the repository; its missions count as code.
        folder: of the files.
        tell: takes a line for each that is drawn.
    """
    folder.mkdir(parents=True, exist_ok=True)
    kept = {name: folder / f"{name}-{_key(root, name)}.svg" for name in figure_names()}
    for name, file in kept.items():
        if not file.is_file():
            tell(f"drawing {name}")
            draw(name, file)
    for file in set(folder.glob("*.svg")) - set(kept.values()):
        file.unlink()
    return kept


def draw(name: str, file: Path) -> None:
    """Draws one figure into a file; the same code gives the same bytes."""
    module: Any = importlib.import_module(f"{figures.__name__}.{name}")
    with style(), matplotlib.rc_context({"svg.hashsalt": name, "svg.fonttype": "path"}):
        figure: Figure = module.figure()
        draft = file.with_suffix(".part")
        figure.savefig(draft, format="svg", metadata={"Date": None, "Creator": None})
        draft.replace(file)


def _key(root: Path, name: str) -> str:
    """What a figure hangs on: the sources that its module imports, all the way down, and the missions."""
    missions = frozenset((root / "config").glob("*.yaml"))
    return hash_of(sources_of(f"{figures.__name__}.{name}") | missions, matplotlib.__version__)
