# SPDX-License-Identifier: Apache-2.0
"""Pages of algorithms: which modules each is about, and what is added to it from the code.

A page in `docs/algorithms/` says in its first lines which modules it is about, which nodes run them and which figures
stand on it:

    ---
    modules: [css_estimation.sun.wavg, css_estimation.health.*]
    nodes: [css_estimation/wavg]
    figures: [wavg]
    ---
"""

import ast
import fnmatch
from collections.abc import Collection, Iterator
from pathlib import Path, PurePosixPath
from typing import NamedTuple

import yaml

from css_common.kernel_sources import KERNEL_PACKAGES
from css_docs.errors import DocsError
from css_docs.figure_files import FIGURES
from css_docs.links import relative
from css_docs.reference.node_pages import page_of
from css_docs.reference.text import code, paragraphs
from css_docs.staging import REPOSITORY

FOLDER = PurePosixPath("algorithms")
FLOWN = ("css_sensors", "css_environment", "css_sim", "css_estimation", "sunpoint_control", "css_calibration")
"""Packages whose kernels are algorithms that a page must tell of; those of the others count, draw and search."""

_WIDTH = 88  # of a line of code on a page
_KEYS = {"modules", "nodes", "figures"}


class AlgorithmPage(NamedTuple):
    """What a page says of itself."""

    page: PurePosixPath
    title: str
    patterns: tuple[str, ...]
    nodes: tuple[str, ...]
    figures: tuple[str, ...]


def algorithm_pages(root: Path) -> list[AlgorithmPage]:
    """Every page of `docs/algorithms/` but the one that lists them.

    Raises:
        DocsError: a page does not say what it is about.
    """
    files = sorted((root / "docs" / FOLDER).glob("*.md"))
    return [_read(file) for file in files if file.stem != "index"]


def _read(file: Path) -> AlgorithmPage:
    text = file.read_text(encoding="utf-8")
    _, mark, rest = text.partition("---\n")
    said = yaml.safe_load(rest.partition("\n---\n")[0]) if mark and text.startswith("---\n") else None
    if not isinstance(said, dict) or not said.keys() <= _KEYS or not said.get("modules"):
        raise DocsError(f"{file}: expected {', '.join(sorted(_KEYS))} between two lines of --- at its beginning")
    lists = [tuple(said.get(key) or ()) for key in ("modules", "nodes", "figures")]
    title = next((line.removeprefix("# ") for line in rest.splitlines() if line.startswith("# ")), file.stem)
    return AlgorithmPage(FOLDER / file.name, title, *lists)


def kernel_modules(root: Path) -> list[str]:
    """Names of all modules with kernels that are algorithms."""
    found = []
    for package in FLOWN:
        folder = root / "src" / package
        for file in sorted((folder / package).rglob("*.py")):
            if _kernels(ast.parse(file.read_text(encoding="utf-8"))):
                found.append(".".join(file.relative_to(folder).with_suffix("").parts))
    return found


def modules_of(page: AlgorithmPage, modules: Collection[str]) -> list[str]:
    """Modules that a page is about, in the order in which it names them."""
    named = (name for pattern in page.patterns for name in fnmatch.filter(modules, pattern))
    return list(dict.fromkeys(named))


def runs(root: Path) -> dict[str, dict[str, PurePosixPath]]:
    """Pages of algorithms, by their titles, by the node `PACKAGE/NODE` that runs them."""
    found: dict[str, dict[str, PurePosixPath]] = {}
    for page in algorithm_pages(root):
        for node in page.nodes:
            found.setdefault(node, {})[page.title] = page.page
    return found


def additions(root: Path, drawn: Collection[str]) -> dict[PurePosixPath, str]:
    """What is added to the end of each page: its figures, the nodes that run it and the code's own words.

    Args:
        drawn: figures that there are.
    """
    modules = all_modules(root)
    return {page.page: _addition(page, modules, root, drawn) for page in algorithm_pages(root)}


def all_modules(root: Path) -> list[str]:
    """Names of all modules of packages with kernels."""
    return [
        ".".join(file.relative_to(root / "src" / package).with_suffix("").parts)
        for package in (*KERNEL_PACKAGES, "css_calibration")
        for file in sorted((root / "src" / package / package).rglob("*.py"))
    ]


def _addition(page: AlgorithmPage, modules: Collection[str], root: Path, drawn: Collection[str]) -> str:
    parts = ["\n"]
    for name in page.figures:
        parts.append(_figure(page, name) if name in drawn else f"(The figure `{name}` is left out of this build.)\n")
    if page.nodes:
        nodes = [tuple(node.split("/")) for node in page.nodes]
        links = ", ".join(f"[`{p} {n}`]({relative(page.page, page_of(p, n))})" for p, n in nodes)
        parts.append(f"## Run by\n\n{links}: topics, and parameters with unit, range and default.\n")
    parts.append("## In the code\n")
    for name in modules_of(page, modules):
        parts += _module(name, root)
    return "\n".join(parts)


def _figure(page: AlgorithmPage, name: str) -> str:
    import importlib

    caption = importlib.import_module(f"css_docs.figures.{name}").CAPTION
    place = relative(page.page, PurePosixPath(FIGURES, f"{name}.svg"))
    source = f"src/css_docs/css_docs/figures/{name}.py"
    figure = f"```{{figure}} {place}\n:alt: {caption.split('.')[0]}\n\n{caption}\n```\n"
    return f"{figure}\nDrawn by [{source}]({REPOSITORY}{source}).\n"


def _module(name: str, root: Path) -> Iterator[str]:
    path = PurePosixPath("src", name.split(".")[0], *name.split(".")).with_suffix(".py")
    tree = ast.parse((root / path).read_text(encoding="utf-8"))
    yield f"### {name}\n\n[{path}]({REPOSITORY}{path})\n\n{paragraphs(ast.get_docstring(tree))}\n"
    for function in _kernels(tree):
        if not function.name.startswith("_"):
            yield code(f"{_signature(function)}\n{_indented(ast.get_docstring(function) or '')}", "text")


def _kernels(tree: ast.Module) -> list[ast.FunctionDef]:
    return [
        node
        for node in tree.body
        if isinstance(node, ast.FunctionDef) and any("kernel" in ast.unparse(mark) for mark in node.decorator_list)
    ]


def _signature(function: ast.FunctionDef) -> str:
    returns = f" -> {ast.unparse(function.returns)}" if function.returns else ""
    line = f"{function.name}({ast.unparse(function.args)}){returns}"
    if len(line) <= _WIDTH:
        return line
    named, given = function.args.args, [ast.unparse(default) for default in function.args.defaults]
    defaults = [""] * (len(named) - len(given)) + [f" = {default}" for default in given]
    arguments = [f"    {ast.unparse(name)}{default}," for name, default in zip(named, defaults, strict=True)]
    return "\n".join((f"{function.name}(", *arguments, f"){returns}"))


def _indented(text: str) -> str:
    return "\n".join(f"    {line}".rstrip() for line in text.splitlines())
