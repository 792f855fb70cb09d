# SPDX-License-Identifier: Apache-2.0
"""A parameter file with a word about each value, as people write theirs."""

import textwrap
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

_WIDTH = 118
_REAL_DIGITS = 10


class Entry(NamedTuple):
    """A parameter, and what is to be said of it."""

    key: str  # dotted, below its section
    value: Any
    comment: str = ""


def parameter_file(heading: str, sections: Iterable[tuple[str, Sequence[Entry]]]) -> str:
    """Text of a file.

    Args:
        heading: what stands above it, paragraphs with empty lines between.
        sections: name of a section and its entries; keys of one branch stand together.
    """
    lines: list[str] = []
    for paragraph in heading.split("\n\n"):
        lines += ["#"] if lines else []
        lines += [f"# {line}" for line in textwrap.wrap(paragraph, _WIDTH - 2)]
    for name, entries in sections:
        if entries:
            lines += [f"{name}:", "  ros__parameters:", *_branch(entries, 4)]
            lines.append("")
    return "\n".join(lines).rstrip() + "\n"


def _branch(entries: Sequence[Entry], indent: int) -> Iterator[str]:
    done: set[str] = set()
    for entry in entries:
        head, dot, _ = entry.key.partition(".")
        if not dot:
            yield from _leaf(entry, indent)
        elif head not in done:
            done.add(head)
            yield f"{' ' * indent}{head}:"
            below = [e._replace(key=e.key[len(head) + 1 :]) for e in entries if e.key.startswith(f"{head}.")]
            yield from _branch(below, indent + 2)


def _leaf(entry: Entry, indent: int) -> Iterator[str]:
    margin = " " * indent
    first, *more = _value_lines(entry.value, margin + " " * (len(entry.key) + 3))
    comment = f"  # {entry.comment}" if entry.comment else ""
    line = f"{margin}{entry.key}: {first}"
    if comment and (more or len(line) + len(comment) > _WIDTH):
        yield from (f"{margin}# {part}" for part in textwrap.wrap(entry.comment, _WIDTH - indent - 2))
        comment = ""
    yield line + comment
    yield from more


def _value_lines(value: Any, margin: str) -> list[str]:
    if not isinstance(value, (list, tuple)):
        return [_word(value)]
    words = [_word(item) for item in value]
    lines = textwrap.wrap(", ".join(words), _WIDTH - len(margin) - 1) or [""]
    lines[0] = f"[{lines[0]}"
    lines[-1] += "]"
    return [lines[0], *(margin + line for line in lines[1:])]


def _word(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return number_word(value)
    if isinstance(value, int):
        return str(value)
    plain = value.replace("/", "").replace("_", "").isalnum() and not value[:1].isdigit()
    return value if plain else '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'


def number_word(value: float) -> str:
    """A number with a point, which ROS takes for one."""
    text = f"{value + 0.0:.{_REAL_DIGITS}g}"
    mantissa, e, exponent = text.partition("e")
    return f"{mantissa if '.' in mantissa else mantissa + '.0'}{e}{exponent}"
