# SPDX-License-Identifier: Apache-2.0
"""Reads which columns of a telemetry table are sun sensor cells, and where the cells look.

YAML:
    cells:
      CSS_1: [0.7071, 0.0, 0.7071]     # column name: outward normal in the body frame
      CSS_2: [0.0, 0.7071, 0.7071]
    field_of_view_deg: 120.0           # optional: full cone of view of a cell
    clip_normal: [0.0, 0.0, 1.0]       # optional: body plane that hides the other half space from each cell
CSV: a header `cell,x,y,z` and a row for each cell.
"""

import csv
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from css_recording.errors import BagError

MOST_CELLS = 32
_CSV_HEADER = ["cell", "x", "y", "z"]
_KEYS = {"cells", "field_of_view_deg", "clip_normal"}
_LENGTH_TOLERANCE = 0.02  # of a normal given with two digits


class CellLayout(NamedTuple):
    """Cells of a spacecraft."""

    names: tuple[str, ...]  # columns of the telemetry table
    normals_b: tuple[tuple[float, float, float], ...]  # outward unit normals
    field_of_view_deg: float = 120.0
    clip_normal_b: tuple[float, float, float] = (0.0, 0.0, 0.0)  # zeros: no plane hides anything


def read_layout(path: Path) -> CellLayout:
    """Cells of a YAML or CSV file; `BagError` names file, cell and what was expected."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise BagError(f"{path}: cannot be read: {error}") from error
    try:
        layout = _from_csv(text) if path.suffix.lower() == ".csv" else _from_yaml(text)
    except ValueError as error:
        raise BagError(f"{path}: {error}") from error
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
    return CellLayout(tuple(cells), tuple(_unit(f"cell {name}", normal) for name, normal in cells.items()))


def _from_yaml(text: str) -> CellLayout:
    try:
        document = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ValueError(f"not valid YAML: {' '.join(str(error).split())}") from error
    if not isinstance(document, dict) or not isinstance(document.get("cells"), dict):
        raise ValueError("expected the key cells with a normal [x, y, z] for each column name")
    unknown = document.keys() - _KEYS
    if unknown:
        raise ValueError(f"unknown key {min(map(str, unknown))}, expected {', '.join(sorted(_KEYS))}")
    cells = {str(name): _unit(f"cell {name}", normal) for name, normal in document["cells"].items()}
    optional: dict[str, Any] = {}
    if "field_of_view_deg" in document:
        optional["field_of_view_deg"] = _number("field_of_view_deg", document["field_of_view_deg"])
        if not 1.0 <= optional["field_of_view_deg"] <= 180.0:
            raise ValueError(f"field_of_view_deg: {document['field_of_view_deg']} given, expected 1 to 180")
    if "clip_normal" in document:
        optional["clip_normal_b"] = _unit("clip_normal", document["clip_normal"])
    return CellLayout(tuple(cells), tuple(cells.values()), **optional)


def _unit(name: str, normal: Any) -> tuple[float, float, float]:
    """A vector given to a few digits, scaled to length 1."""
    if not isinstance(normal, Iterable) or isinstance(normal, str) or len(list(normal)) != 3:
        raise ValueError(f"{name}: {normal!r} given, expected a unit vector [x, y, z]")
    x, y, z = (_number(name, value) for value in normal)
    length = math.sqrt(x * x + y * y + z * z)
    if not abs(length - 1.0) <= _LENGTH_TOLERANCE:
        raise ValueError(f"{name}: a normal of length {length:.4g} given, expected a unit vector")
    return x / length, y / length, z / length


def _number(name: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if isinstance(value, bool) or not math.isfinite(number):
        raise ValueError(f"{name}: {value!r} given, expected a number")
    return number
