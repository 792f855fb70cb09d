# SPDX-License-Identifier: Apache-2.0
"""Keys of a mission, from the sections that it is checked against, and what it may script, draw, break and demand."""

from collections.abc import Iterator
from pathlib import Path, PurePosixPath

from css_analysis.quantities import QUANTITIES, needed_windows
from css_common import dispersions, distributions, fault_lines, mission_extends
from css_common.link_kinds import KINDS as LINK_KINDS
from css_common.mission_script import ACTIONS, EVENT_KEYS
from css_common.readme_parameters import FAULT_HEADER, HEADER, fault_row, row
from css_common.shared_sections import shared_sections
from css_docs.reference.node_pages import FOLDER as NODES
from css_docs.reference.node_pages import KEYS, components
from css_docs.reference.text import code, paragraphs, plain, table
from css_docs.staging import REPOSITORY

MISSIONS = PurePosixPath("reference", "missions.md")
QUANTITY_PAGE = PurePosixPath("reference", "quantities.md")


def pages(root: Path) -> Iterator[tuple[PurePosixPath, str]]:
    """Keys, missions that come with Sunpoint, and what is measured of flights."""
    yield KEYS, _keys(root)
    yield MISSIONS, _missions(root)
    yield QUANTITY_PAGE, _quantities()


def _keys(root: Path) -> str:
    parts = [
        "# Mission keys\n\nA mission is a ROS 2 parameter file. Sections that several nodes share stand under `/**: "
        "ros__parameters:`, parameters of one node under its name. Every reader checks the whole file first; `--set "
        "KEY=VALUE` changes one value. A value that has no default is asked for by the nodes that need it.\n",
        f"## extends\n\n{paragraphs(mission_extends.__doc__)}\n",
    ]
    for name, section in shared_sections().items():
        rows = "\n".join((*HEADER, *(row(p) for p in section.table)))
        parts.append(f"## {name}\n\n{rows}\n")
    lines = [
        (f"[`{name}`]({NODES.name}/{package}/{name}.md)", ", ".join(f"`{p.name}`" for p in kind.parameters))
        for (package, name), kind in components(root).items()
        if kind.parameters
    ]
    parts.append(f"## Sections of nodes\n\n{table(('node', 'parameters'), lines)}")
    keys, actions = ", ".join(sorted(EVENT_KEYS)), ", ".join(f"`{action}`" for action in ACTIONS)
    parts.append(
        f"## events\n\nScripted changes: `events: {{NAME: {{{keys}}}}}`. `time` [s] counts from `mission.epoch`, "
        f"`node` is one of the graph, `action` one of {actions}; `set` takes `parameter` and `value`, of a parameter "
        "with a star.\n"
    )
    kinds = dict.fromkeys(k for kind in components(root).values() for k in kind.fault_kinds)
    rows = "\n".join((*FAULT_HEADER, *(fault_row(kind) for kind in (*kinds, *LINK_KINDS))))
    entry = "\n".join((*HEADER, *(row(p) for p in fault_lines.ENTRY)))
    parts.append(
        f"## faults\n\n`faults: {{NAME: {{target, kind, ...}}}}`, with these keys and those of its kind:\n\n{entry}\n"
    )
    parts.append(f"As a line of a node's parameter `faults` it is `{fault_lines.FORM}`.\n\n{rows}\n")
    parts.append(f"## dispersions\n\n{paragraphs(dispersions.__doc__)}\n\n{paragraphs(distributions.__doc__)}\n")
    parts.append(
        f"## criteria\n\n`criteria: {{QUANTITY: {{min, max}}}}`, with any of the [quantities]({QUANTITY_PAGE.name}). "
        "They are the exit code of a flight, and with `measures.required_share` of a study.\n"
    )
    return "\n".join(parts)


def _missions(root: Path) -> str:
    parts = ["# Missions\n\nThose in `config/`. A name without a path is looked for there.\n"]
    for file in sorted((root / "config").glob("*.yaml")):
        remark = []
        for line in file.read_text(encoding="utf-8").splitlines():
            if not line.startswith("#"):
                break
            if "SPDX" not in line:
                remark.append(line.removeprefix("#").removeprefix(" "))
        path = file.relative_to(root).as_posix()
        parts.append(f"## {file.stem}\n\n{_remark(remark)}\n\n[{path}]({REPOSITORY}{path})\n")
    return "\n".join(parts)


def _remark(lines: list[str]) -> str:
    """The comment at the head of a mission: its text, and the commands in it as code."""
    text: list[str] = []
    commands: list[str] = []
    for line in lines:
        (commands if line.startswith("  ") else text).append(line.strip())
    return plain("\n".join(text)) + (f"\n\n{code(chr(10).join(commands), 'bash')}" if commands else "")


def _quantities() -> str:
    rows = []
    for q in QUANTITIES.values():
        asked = ", ".join(f"`measures.{key}`" for key in needed_windows(q.name))
        empty = f"; none: {plain(q.without_value)}" if q.without_value else ""
        rows.append((f"`{q.name}`", plain(q.unit or "-"), plain(q.description) + empty, asked))
    return (
        "# Quantities\n\nWhat is measured of a flight, under the same name in `--json`, in `criteria` and, with few "
        "exceptions, in the tables of a study.\n\n" + table(("name", "unit", "what it is", "only with"), rows)
    )
