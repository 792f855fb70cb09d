# SPDX-License-Identifier: Apache-2.0
"""Reads which columns of a telemetry table are sun sensor cells, and where the cells look (form: `table_forms`)."""

import csv
import math
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from css_recording.errors import BagError
from css_telemetry.table_values import plain_number

MOST_CELLS = 32
_CSV_HEADER = ["cell", "x", "y", "z"]
_KEYS = {"cells", "field_of_view_deg", "clip_normal", "dark_level", "full_scale"}
_LENGTH_TOLERANCE = 0.02  # of a normal given with two digits
_LONGEST_SHOWN = 40  # characters of a wrong value in a message


class CellLayout(NamedTuple):
    """Cells of a spacecraft."""

    names: tuple[str, ...]  # columns of the telemetry table
    normals_b: tuple[tuple[float, float, float], ...]  # outward unit normals
    field_of_view_deg: float = 120.0
    clip_normal_b: tuple[float, float, float] = (0.0, 0.0, 0.0)  # zeros: no plane hides anything
    dark_level: tuple[float, ...] | None = None  # of each cell, in the unit of the table
    full_scale: tuple[float, ...] | None = None  # of each cell, above its dark level


class _TextLoader(yaml.BaseLoader):
    """Leaves every word as it stands, whatever its tag, and refuses keys that stand twice."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = set()
        for key_node, _ in node.value:
            line = key_node.start_mark.line + 1
            if not isinstance(key_node, yaml.ScalarNode):
                raise ValueError(f"line {line}: expected a word as key")
            if key_node.value in keys:
                raise ValueError(f"line {line}: {key_node.value} stands twice")
            keys.add(key_node.value)
        return super().construct_mapping(node, deep)


def read_layout(path: Path) -> CellLayout:
    """Cells of a YAML or CSV file; `BagError` names file, cell and what was expected."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise BagError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise BagError(f"{path}: cannot be read: {error}") from error
    try:
        layout = _from_csv(text) if path.suffix.lower() == ".csv" else _from_yaml(text)
    except (ValueError, csv.Error) as error:
        raise BagError(f"{path}: {' '.join(str(error).split())}") from error
    if not 1 <= len(layout.names) <= MOST_CELLS:
        raise BagError(f"{path}: {len(layout.names)} cells given, expected 1 to {MOST_CELLS}")
    return layout


def _from_csv(text: str) -> CellLayout:
    rows = [[field.strip() for field in row] for row in csv.reader(text.splitlines()) if row]
    if not rows or [name.lower() for name in rows[0]] != _CSV_HEADER:
        raise ValueError(f"line 1: expected the header {','.join(_CSV_HEADER)}")
    cells: dict[str, Any] = {}
    for row in rows[1:]:
        if len(row) != len(_CSV_HEADER):
            raise ValueError(f"cell {row[0]}: expected a name and three numbers, found {len(row)} fields")
        if row[0] in cells:
            raise ValueError(f"cell {row[0]} stands twice")
        cells[row[0]] = row[1:]
    return CellLayout(tuple(cells), _normals(cells))


def _from_yaml(text: str) -> CellLayout:
    try:
        # a BaseLoader subclass: builds texts, lists and dictionaries only
        document = yaml.load(text, _TextLoader)
    except (yaml.YAMLError, RecursionError) as error:
        raise ValueError(f"not valid YAML: {error}") from error
    if not isinstance(document, dict) or not isinstance(document.get("cells"), dict):
        raise ValueError("expected the key cells with a normal [x, y, z] for each column name")
    unknown = document.keys() - _KEYS
    if unknown:
        raise ValueError(f"unknown key {min(unknown)}, expected {', '.join(sorted(_KEYS))}")
    names = tuple(document["cells"])
    optional: dict[str, Any] = {}
    if "field_of_view_deg" in document:
        optional["field_of_view_deg"] = _number("field_of_view_deg", document["field_of_view_deg"])
        if not 1.0 <= optional["field_of_view_deg"] <= 180.0:
            raise ValueError(f"field_of_view_deg: {document['field_of_view_deg']} given, expected 1 to 180")
    if "clip_normal" in document:
        optional["clip_normal_b"] = _unit("clip_normal", document["clip_normal"])
    if "dark_level" in document:
        optional["dark_level"] = _for_each_cell("dark_level", document["dark_level"], names)
    if "full_scale" in document:
        optional["full_scale"] = _for_each_cell("full_scale", document["full_scale"], names)
        if not min(optional["full_scale"], default=1.0) > 0.0:
            raise ValueError(f"full_scale: {min(optional['full_scale']):g} given, expected a number above 0")
    return CellLayout(names, _normals(document["cells"]), **optional)


def _normals(cells: dict[str, Any]) -> tuple[tuple[float, float, float], ...]:
    for name in cells:
        if not name.strip():
            raise ValueError("a cell has no name")
    return tuple(_unit(f"cell {name}", normal) for name, normal in cells.items())


def _for_each_cell(key: str, given: Any, names: tuple[str, ...]) -> tuple[float, ...]:
    if not isinstance(given, dict):
        return (_number(key, given),) * len(names)
    different = set(names) ^ given.keys()
    if different:
        raise ValueError(f"{key}: {min(different)} is not in both, expected a number for each of the cells")
    return tuple(_number(f"{key}: {name}", given[name]) for name in names)


def _unit(name: str, normal: Any) -> tuple[float, float, float]:
    """A vector given to a few digits, scaled to length 1."""
    if not isinstance(normal, list) or len(normal) != 3:
        raise ValueError(f"{name}: {_shown(normal)} given, expected a unit vector [x, y, z]")
    x, y, z = (_number(name, value) for value in normal)
    length = math.hypot(x, y, z)
    if not abs(length - 1.0) <= _LENGTH_TOLERANCE:
        raise ValueError(f"{name}: a normal of length {length:.4g} given, expected a unit vector")
    return x / length, y / length, z / length


def _number(name: str, value: Any) -> float:
    number = plain_number(value) if isinstance(value, str) else math.inf
    if not math.isfinite(number):
        raise ValueError(f"{name}: {_shown(value)} given, expected a number")
    return number


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}..."
