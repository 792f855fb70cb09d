# SPDX-License-Identifier: Apache-2.0
"""Reading and writing of ROS 2 parameter files, strict where YAML and ROS are silent."""

import os
import re
import stat
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from css_common.file_text import decoded
from css_common.parameter_document import DocumentError, read_document
from css_common.parameter_words import Dumper

MOST_BYTES = 4_000_000
"""Size of a parameter file above which it is something else."""

_PARAMETERS = "ros__parameters"
_UNPRINTABLE = re.compile(r"[\x00-\x1f\x7f-\x9f\ud800-\udfff]")
_SECTION = re.compile(r"/?(\*\*?|[A-Za-z_]\w*)(/(\*\*?|[A-Za-z_]\w*))*", re.ASCII)


class MissionError(Exception):
    """A mission that cannot be flown: one line that names file, key, value and what was expected."""

    def __init__(self, message: str) -> None:
        line = " ".join(message.splitlines())
        super().__init__(_UNPRINTABLE.sub(lambda found: repr(found[0])[1:-1], line))


def read_text(path: str | Path) -> str:
    """The text of a parameter file: UTF-8, or UTF-16 with its mark, which ROS reads as well.

    Raises:
        MissionError: it is no regular file, too large for what it should be, cannot be read or holds no text.
    """
    try:
        status = os.stat(path)
        if not stat.S_ISREG(status.st_mode):
            raise MissionError(f"{path}: cannot be read: expected a regular file")
        if status.st_size > MOST_BYTES:
            raise MissionError(f"{path}: cannot be read: {status.st_size} bytes, expected at most {MOST_BYTES}")
        return decoded(Path(path).read_bytes())
    except OSError as error:
        raise MissionError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:  # bytes that are no text; a name that no file can have
        raise MissionError(f"{path}: cannot be read: {error}") from error


def read_sections(text: str, origin: str) -> dict[str, dict[str, Any]]:
    """Section to nested parameters of a parameter file; namespaces written as maps are part of a section's name.

    Raises:
        MissionError: the text is no parameter file.
    """
    try:
        document = read_document(text)
    except DocumentError as error:
        raise MissionError(f"{origin}: {error}") from error
    if document is None:
        return {}
    if not isinstance(document, Mapping):
        raise MissionError(f"{origin}: expected node names at the top, found {type(document).__name__}")
    result: dict[str, dict[str, Any]] = {}
    seen: set[str] = set()
    for name, parameters in _sections(document, "", origin):
        if name.lstrip("/") in seen:
            raise MissionError(f"{origin}: {name.lstrip('/')} stands twice")
        _refuse_twice(parameters, f"{origin}: {name}")
        seen.add(name.lstrip("/"))
        result[name] = dict(parameters)
    return result


def _sections(bodies: Mapping[str, Any], space: str, place: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    for key, body in bodies.items():
        name = f"{space}/{key}" if space else key
        here = place if space else f"{place}: {key}"
        if isinstance(body, (str, int, float, list)) and not space and "/" not in key:
            raise MissionError(
                f"{here}: stands at the top, expected below a section, such as /**: {{{_PARAMETERS}: ...}}"
            )
        if not isinstance(body, Mapping) or (_PARAMETERS in body and len(body) > 1):
            raise MissionError(f"{here}: expected the one key {_PARAMETERS} below it")
        if _PARAMETERS not in body:
            yield from _sections(body, name, here)
            continue
        if not _SECTION.fullmatch(name):
            raise MissionError(f"{here}: expected the name of a node, {name!r} is none")
        parameters = body[_PARAMETERS]
        if not isinstance(parameters, Mapping):
            raise MissionError(f"{here}: {_PARAMETERS} must hold keys and values")
        yield name, parameters


def _refuse_twice(parameters: Mapping[str, Any], place: str) -> None:
    for name, count in Counter(name for name, _ in _leaves(parameters)).items():
        if count > 1:
            raise MissionError(f"{place}: {name} stands twice, once as a dotted name")


def flattened(nested: Mapping[str, Any]) -> dict[str, Any]:
    """Dotted names and values of nested parameters."""
    return dict(_leaves(nested))


def _leaves(nested: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in nested.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def dump_sections(parameters: Mapping[str, Mapping[str, Any]]) -> str:
    """A parameter file of section names and flat parameters."""
    document = {section: {_PARAMETERS: _nested(flat)} for section, flat in parameters.items() if flat}
    return yaml.dump(document, Dumper=Dumper, sort_keys=False, default_flow_style=None, width=110)


def _nested(flat: Mapping[str, Any]) -> dict[str, Any]:
    root: dict[str, Any] = {}
    for name, value in flat.items():
        *path, leaf = name.split(".")
        at: Any = root
        for part in path:
            at = at.setdefault(part, {}) if isinstance(at, dict) else None
        if isinstance(at, dict) and leaf not in at:
            at[leaf] = value
        else:  # one name is the beginning of another
            root[name] = value
    return root
