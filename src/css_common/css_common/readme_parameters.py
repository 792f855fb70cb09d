# SPDX-License-Identifier: Apache-2.0
"""The tables of parameters in the READMEs of packages, from the tables that the nodes declare.

    ./sunpoint shell -c 'python -m css_common.readme_parameters src/*/README.md'

writes them anew where they stand: below a heading `### NODE`, with the columns of `HEADER`; that of the faults that
the units of those nodes may have, with the columns of `FAULT_HEADER`.
"""

import re
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from css_common.fault_lines import FaultKind
from css_common.link_kinds import KINDS as LINK_KINDS
from css_common.node_files import find_component
from css_common.schema import Parameter

HEADER = ("| parameter | default | unit | range | meaning |", "|---|---|---|---|---|")

FAULT_HEADER = ("| target | fault | values | what it does |", "|---|---|---|---|")

_FAULTS = re.compile("(?P<before>" + "\n".join(map(re.escape, FAULT_HEADER)) + r"\n)(?:\|.*\n)*")
_TABLE = re.compile(
    r"(?P<before>^### (?P<node>\w+)\n(?:(?!#).*\n)*?" + "\n".join(map(re.escape, HEADER)) + r"\n)(?:\|.*\n)*", re.M
)


def rewritten(text: str, package: str) -> str:
    """The README of a package with its tables as the nodes have them.

    Raises:
        MissionError: a heading names no node of the package.
    """

    def table(found: re.Match[str]) -> str:
        rows = (f"{row(p)}\n" for p in find_component(package, found["node"]).parameters)
        return found["before"] + "".join(rows)

    kinds = dict.fromkeys(kind for node in documented(text) for kind in find_component(package, node).fault_kinds)
    kinds = kinds or dict.fromkeys(LINK_KINDS)  # where no node is, those that any node has
    faults = "".join(f"{fault_row(kind)}\n" for kind in kinds)
    return _FAULTS.sub(lambda found: found["before"] + faults, _TABLE.sub(table, text))


def documented(text: str) -> list[str]:
    """Nodes with a table in a README."""
    return [found["node"] for found in _TABLE.finditer(text)]


def row(p: Parameter[Any]) -> str:
    """The line of a parameter; a star means that it may change in flight."""
    name = f"`{p.name}`" + (" *" if p.tunable else "")
    meaning = p.description.replace("|", r"\|")
    return f"| {name} | {_value(p.default)} | {p.unit} | {_range(p)} | {meaning} |"


def fault_row(kind: FaultKind) -> str:
    """The line of a kind of fault."""
    values = ", ".join(
        f"`{p.name}` {', '.join(filter(None, (p.unit, _range(p))))}" for p in (v.parameter for v in kind.values)
    )
    return f"| {kind.sort}{', all' if kind.whole else ''} | `{kind.name}` | {values} | {kind.description} |"


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_value, value))}]"
    if value != value:
        return "(none)"
    return f"{value:g}" if isinstance(value, float) else str(value) or "(empty)"


def _range(p: Parameter[Any]) -> str:
    return ", ".join(p.choices) or " .. ".join(_bounds(p))


def _bounds(p: Parameter[Any]) -> Iterator[str]:
    if p.low is not None:
        sign = "> " if p.open_low else "" if p.high is not None else ">= "
        yield f"{sign}{p.low:g}"
    if p.high is not None:
        yield f"{'<= ' if p.low is None else ''}{p.high:g}"


def main(arguments: Sequence[str]) -> None:
    """Rewrites the READMEs whose paths are given."""
    for name in arguments:
        path = Path(name)
        path.write_text(rewritten(path.read_text(encoding="utf-8"), path.resolve().parent.name), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
