# SPDX-License-Identifier: Apache-2.0
"""Blocks of code in the documents, with the mark in the line before each: see src/css_docs/README.md."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
PAGES = sorted((ROOT / "docs").rglob("*.md"))
_MARK = re.compile(r"<!-- (run|run long|output|file: (?P<file>\S+)|illustrative: (?P<why>.+)) -->")
_NO_CODE = re.compile(r"\{\w[\w-]*\}|mermaid")


class Block(NamedTuple):
    """One block."""

    line: int  # of its first fence
    language: str
    mark: str  # the first word of it, or `run long`; empty without one
    detail: str  # name of the file, or why it is not run
    text: str


def blocks(page: Path) -> list[Block]:
    """All of a page but diagrams and the directives of Sphinx."""
    return list(_blocks(page.read_text(encoding="utf-8").splitlines()))


def _blocks(lines: list[str]) -> Iterator[Block]:
    at = 0
    while at < len(lines):
        fence = re.match(r"(`{3,})(.*)", lines[at])
        if fence is None:
            at += 1
            continue
        end = next(k for k in range(at + 1, len(lines)) if lines[k].strip() == fence[1])
        language = fence[2].strip()
        if not _NO_CODE.match(language):
            found = _MARK.fullmatch(lines[at - 1].strip()) if at else None
            mark = "" if found is None else "run long" if found[1] == "run long" else found[1].partition(":")[0]
            detail = "" if found is None else found["file"] or found["why"] or ""
            yield Block(at + 1, language, mark, detail, "\n".join(lines[at + 1 : end]) + "\n")
        at = end + 1


def missing(expected: str, printed: str) -> list[str]:
    """Lines of an expected output that were not printed, in their order; `...` stands for anything."""
    rest = printed.splitlines()
    lost = []
    for line in expected.splitlines():
        if not line.strip() or line.strip() == "...":
            continue
        pattern = re.compile(".*".join(re.escape(part.strip()) for part in line.split("...")))
        found = next((k for k, other in enumerate(rest) if pattern.search(other.strip())), None)
        if found is None:
            lost.append(line)
        else:
            rest = rest[found + 1 :]
    return lost
