# SPDX-License-Identifier: Apache-2.0
"""Pieces of pages that are made."""

import re
from collections.abc import Iterable, Sequence

# what Markdown would take for a mark of its own
_MARKS = re.compile(r"([\\*_\[\]<>$|`])")


def plain(text: str) -> str:
    """A text from the code, whose characters are to be read as they are; between backticks they are code."""
    parts = re.split(r"(`[^`]+`)", text)
    return "".join(p.replace("|", r"\|") if p.startswith("`") else _MARKS.sub(r"\\\1", p) for p in parts)


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; empty where there are no rows."""
    lines = [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join([f"| {' | '.join(heads)} |", f"|{'---|' * len(heads)}", *lines, ""]) if lines else ""


def code(text: str, language: str = "text") -> str:
    """A block of code."""
    return f"````{{code-block}} {language}\n\n{text.rstrip()}\n````\n"


def contents(pages: Iterable[str], depth: int = 1) -> str:
    """A table of contents of pages, without their ending."""
    listed = "\n".join(pages)
    return f"```{{toctree}}\n:maxdepth: {depth}\n\n{listed}\n```\n"


def paragraphs(docstring: str | None) -> str:
    """A docstring as text: its lists and indented lines stay as they are written."""
    blocks = re.split(r"\n\s*\n", (docstring or "").strip())
    return "\n\n".join(_block(block) for block in blocks)


def _block(block: str) -> str:
    lines = block.splitlines()
    if all(line.startswith("    ") for line in lines):
        return code("\n".join(line.removeprefix("    ") for line in lines))
    if any(line.startswith((" ", "\t")) for line in lines):
        return code(block)
    return "\n".join(plain(line) for line in lines)
