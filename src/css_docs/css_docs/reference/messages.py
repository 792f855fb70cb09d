# SPDX-License-Identifier: Apache-2.0
"""Messages, from their `.msg` files: fields, units, constants, as these say them."""

import re
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from css_docs.reference.text import contents, plain, table
from css_docs.staging import REPOSITORY

FOLDER = PurePosixPath("reference", "messages")
_LINE = re.compile(
    r"(?P<type>[\w/]+(?:\[[<=\d]*\])?)\s+(?P<name>\w+)\s*(?:=\s*(?P<value>[^#]+?))?\s*(?:#\s*(?P<note>.*))?"
)
_UNIT = re.compile(r"\[(?P<unit>[^\]]+)\]\s*(?P<rest>.*)")


class Field(NamedTuple):
    """A line of a message: a field, or a constant with its value."""

    type: str
    name: str
    value: str
    unit: str
    meaning: str


class Interface(NamedTuple):
    """A message or service: what it is, and the fields of its parts (a service has two)."""

    name: str
    file: Path
    purpose: str
    parts: tuple[tuple[Field, ...], ...]


def interfaces(root: Path) -> list[Interface]:
    """Those of `css_msgs`, by name."""
    files = sorted(root.glob("src/css_msgs/msg/*.msg")) + sorted(root.glob("src/css_msgs/srv/*.srv"))
    return [_interface(file) for file in files]


def _interface(file: Path) -> Interface:
    parts: list[list[Field]] = [[]]
    purpose: list[str] = []
    heading = True
    for line in file.read_text(encoding="utf-8").splitlines():
        text = line.strip()
        if text.startswith("#"):
            note = text.lstrip("# ")
            if heading:
                purpose.append(note)
            elif parts[-1]:
                last = parts[-1][-1]
                parts[-1][-1] = last._replace(meaning=f"{last.meaning} {note}".strip())
        elif text == "---":
            parts.append([])
        elif text:
            heading = False
            parts[-1].append(_field(text, file))
        elif purpose:
            heading = False
    return Interface(file.stem, file, " ".join(purpose), tuple(map(tuple, parts)))


def _field(text: str, file: Path) -> Field:
    found = _LINE.fullmatch(text)
    if found is None:
        raise ValueError(f"{file}: {text!r} is no field of a message")
    note = found["note"] or ""
    unit = _UNIT.match(note)
    return Field(
        found["type"], found["name"], (found["value"] or "").strip(), unit["unit"] if unit else "",
        unit["rest"] if unit else note,
    )  # fmt: skip


def pages(root: Path) -> Iterator[tuple[PurePosixPath, str]]:
    """A page for each message, and one that lists them."""
    found = interfaces(root)
    rows = [(f"[{i.name}]({i.name}.md)", plain(i.purpose)) for i in found]
    listed = contents(i.name for i in found)
    yield (
        FOLDER / "index.md",
        f"# Messages\n\nOf `css_msgs`, made from their files. Others are ROS's own: `sensor_msgs/Imu`, "
        f"`sensor_msgs/MagneticField`, `diagnostic_msgs/DiagnosticArray`.\n\n{table(('message', 'what it is'), rows)}\n"
        f"{listed.replace(':maxdepth', ':hidden:' + chr(10) + ':maxdepth')}",
    )
    for interface in found:
        yield FOLDER / f"{interface.name}.md", _page(interface, root)


def _page(interface: Interface, root: Path) -> str:
    source = interface.file.relative_to(root).as_posix()
    text = [f"# {interface.name}\n\n{plain(interface.purpose)}\n\n[{source}]({REPOSITORY}{source})\n"]
    titles = ("Request", "Response") if interface.file.suffix == ".srv" else ("",)
    for title, part in zip(titles, interface.parts, strict=True):
        if title:
            text.append(f"## {title}\n")
        fields = [(f"`{f.name}`", f"`{f.type}`", plain(f.unit), plain(f.meaning)) for f in part if not f.value]
        constants = [(f"`{f.name}`", f.value, plain(f.meaning)) for f in part if f.value]
        text.append(table(("field", "type", "unit", "meaning"), fields) or "No fields.\n")
        text.append(table(("constant", "value", "meaning"), constants))
    return "\n".join(text)


def link(message_type: type, page: PurePosixPath) -> str:
    """A message class as a link from a page of the site; of ROS's own messages the name alone."""
    from css_docs.links import relative

    package = message_type.__module__.split(".")[0]
    name = f"`{package}/{message_type.__name__}`"
    return f"[{name}]({relative(page, FOLDER / f'{message_type.__name__}.md')})" if package == "css_msgs" else name
