# SPDX-License-Identifier: Apache-2.0
"""Reads a description of a table of telemetry, or the layout of its cells alone (forms: `table_forms`)."""

import csv
from itertools import pairwise
from pathlib import Path
from typing import Any

from css_common.file_text import decoded
from css_recording.errors import BagError
from css_sensors.cells import MOST_CELLS
from css_telemetry.description import CellForm, Description, TableForm, Thermal, TimeForm
from css_telemetry.entries import Children, Entry, document_of
from css_telemetry.instants import instant_ns
from css_telemetry.role_entries import aiding_of, truth_of
from css_telemetry.table_text import SEPARATORS
from css_telemetry.units import OUTPUTS, TIME_UNITS, plain_unit

_CSV_HEADER = ["cell", "x", "y", "z"]
_KEYS = (
    "aiding", "cells", "clip_normal", "dark_level", "field_of_view_deg", "full_scale", "inertia", "missing", "table",
    "time", "truth", "unit",
)  # fmt: skip
_CELL_KEYS = ("column", "dark_level", "full_scale", "lookup", "normal", "temperature", "unit", "field_of_view_deg")
_WORDS_OF_SEPARATORS = {"tab": "\t", "space": " ", "comma": ",", "semicolon": ";", "bar": "|", "\\t": "\t"}


def read_description(path: Path) -> Description:
    """The description in a YAML file, or the layout in a YAML or CSV file.

    Raises:
        BagError: it cannot be read; names file, key, value and what was expected.
    """
    try:
        text = decoded(path.read_bytes())
    except OSError as error:
        raise BagError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise BagError(f"{path}: cannot be read: {error}") from error
    try:
        description = _from_csv(text) if path.suffix.lower() == ".csv" else description_of(text)
    except (ValueError, csv.Error) as error:
        raise BagError(f"{path}: {' '.join(str(error).split())}") from error
    if not 1 <= len(description.cells) <= MOST_CELLS:
        raise BagError(f"{path}: {len(description.cells)} cells given, expected 1 to {MOST_CELLS}")
    return description


def _from_csv(text: str) -> Description:
    rows = [[field.strip() for field in row] for row in csv.reader(text.splitlines()) if row]
    if not rows or [name.lower() for name in rows[0]] != _CSV_HEADER:
        raise ValueError(f"line 1: expected the header {','.join(_CSV_HEADER)}")
    cells: dict[str, CellForm] = {}
    for row in rows[1:]:
        if len(row) != len(_CSV_HEADER):
            raise ValueError(f"cell {row[0]}: expected a name and three numbers, found {len(row)} fields")
        name = _named(row[0])
        if name in cells:
            raise ValueError(f"cell {name} stands twice")
        cells[name] = CellForm(name, name, Entry(row[1:], f"cell {name}").unit_vector())
    return Description(tuple(cells.values()))


def description_of(text: str) -> Description:
    """The description of a YAML text.

    Raises:
        ValueError: it is none; names key, value and what was expected.
    """
    document = document_of(text)
    if not isinstance(document, dict) or not isinstance(document.get("cells"), dict):
        raise ValueError("expected the key cells with a normal [x, y, z] for each column name")
    keys = Entry(document).children(_KEYS)
    optional: dict[str, Any] = {}
    cells = _cells(keys)
    optional["field_of_view_deg"] = _view(keys.get("field_of_view_deg"))
    if (clip := keys.get("clip_normal")) is not None:
        optional["clip_normal_b"] = clip.unit_vector()
    if (table := keys.get("table")) is not None:
        optional["table"] = _table(table)
    if (time := keys.get("time")) is not None:
        optional["time"] = _time(time)
    if (missing := keys.get("missing")) is not None:
        optional["missing"] = missing.numbers()
    if (aiding := keys.get("aiding")) is not None:
        optional["aiding"] = aiding_of(aiding)
    if (truth := keys.get("truth")) is not None:
        optional["truth"] = truth_of(truth)
    if (inertia := keys.get("inertia")) is not None:
        optional["inertia"] = inertia.numbers(9)
    return Description(cells, **optional)


def _named(name: str) -> str:
    if not name.strip():
        raise ValueError("a cell has no name")
    return name


def _cells(keys: Children) -> tuple[CellForm, ...]:
    given = keys["cells"].value
    scales = _for_each_cell(keys, "full_scale", given)
    darks = _for_each_cell(keys, "dark_level", given)
    unit = _unit(keys.get("unit"))
    cells = []
    for name, value in given.items():
        _named(name)
        entry = Entry(value, f"cell {name}")
        if isinstance(value, dict):
            own = entry.children(_CELL_KEYS)
            cells.append(_cell(name, own, unit, scales.get(name), darks.get(name)))
        else:
            cells.append(
                CellForm(name, name, entry.unit_vector(), unit, _positive(scales.get(name)), _number(darks.get(name)))
            )
    return tuple(cells)


def _cell(name: str, own: Children, unit: str, scale: Entry | None, dark: Entry | None) -> CellForm:
    lookup = own.get("lookup")
    thermal = own.get("temperature")
    column = own.get("column")
    return CellForm(
        name,
        name if column is None else column.word(),
        own["normal"].unit_vector(),
        _unit(own.get("unit")) or unit,
        _positive(own.get("full_scale") or scale),
        _number(own.get("dark_level") or dark),
        None if lookup is None else _lookup(lookup),
        None if thermal is None else _thermal(thermal),
        _view(own.get("field_of_view_deg")),
    )


def _for_each_cell(keys: Children, key: str, names: dict[str, Any]) -> dict[str, Entry]:
    """The entry of each cell: one number for all, or one for each."""
    entry = keys.get(key)
    if entry is None:
        return {}
    if not isinstance(entry.value, dict):
        return dict.fromkeys(names, entry)
    different = set(names) ^ entry.value.keys()
    if different:
        raise ValueError(f"{key}: {min(different)} is not in both, expected a number for each of the cells")
    return {name: Entry(value, f"{key}: {name}") for name, value in entry.value.items()}


def _positive(entry: Entry | None) -> float | None:
    return None if entry is None else entry.positive()


def _number(entry: Entry | None) -> float | None:
    return None if entry is None else entry.number()


def _unit(entry: Entry | None) -> str:
    if entry is None:
        return ""
    unit = plain_unit(entry.word())
    if unit not in OUTPUTS:
        raise entry.wrong(f"one of {', '.join(OUTPUTS)}")
    return unit


def _lookup(entry: Entry) -> tuple[tuple[float, ...], tuple[float, ...]]:
    pairs = [pair.numbers(2) for pair in entry.items()]
    readings, outputs = tuple(p[0] for p in pairs), tuple(p[1] for p in pairs)
    if len(pairs) < 2 or any(b <= a for a, b in pairwise(readings)):
        raise ValueError(f"{entry.name}: expected two or more pairs [reading, output] whose readings grow")
    return readings, outputs


def _thermal(entry: Entry) -> Thermal:
    keys = entry.children(("column", "coefficient", "reference"))
    return Thermal(keys["column"].word(), keys["coefficient"].number(), keys["reference"].number())


def _view(entry: Entry | None) -> float | None:
    """A full cone of view."""
    if entry is None:
        return None
    angle = entry.number()
    if not 1.0 <= angle <= 180.0:
        raise ValueError(f"{entry.name}: {entry.value} given, expected 1 to 180")
    return angle


def _table(entry: Entry) -> TableForm:
    keys = entry.children(("separator", "decimal", "encoding", "sheet", "units_row", "long", "absent"))
    given: dict[str, Any] = {}
    if (separator := keys.get("separator")) is not None:
        mark = separator.value if separator.value in SEPARATORS else _WORDS_OF_SEPARATORS.get(str(separator.value))
        if mark is None:
            raise separator.wrong('one of ",", ";", "|", tab, space')
        given["separator"] = mark
    if (decimal := keys.get("decimal")) is not None:
        given["decimal"] = decimal.word((".", ","))
    if (encoding := keys.get("encoding")) is not None:
        given["encoding"] = _encoding(encoding)
    if (sheet := keys.get("sheet")) is not None:
        given["sheet"] = sheet.word()
    if (units_row := keys.get("units_row")) is not None:
        given["units_row"] = units_row.yes()
    if (long := keys.get("long")) is not None:
        names = long.children(("name", "value"))
        given["long_name"], given["long_value"] = names["name"].word(), names["value"].word()
    if (absent := keys.get("absent")) is not None:
        given["absent"] = absent.words()
    return TableForm(**given)


def _encoding(entry: Entry) -> str:
    name = entry.word()
    try:
        "".encode(name)
    except LookupError as error:
        raise entry.wrong("an encoding such as utf-8, utf-16, latin-1") from error
    return name


def _time(entry: Entry) -> TimeForm:
    from css_telemetry.description import SCALES

    keys = entry.children(("column", "columns", "unit", "scale", "epoch"))
    if ("column" in keys) == ("columns" in keys):
        raise ValueError(f"{entry.name}: expected either column, or columns with two names")
    columns = (keys["column"].word(),) if "column" in keys else keys["columns"].words(2)
    unit = "s"
    if (given := keys.get("unit")) is not None:
        unit = plain_unit(given.word())
        if unit not in TIME_UNITS:
            raise given.wrong(f"one of {', '.join(TIME_UNITS)}")
    scale = keys["scale"].word(SCALES) if "scale" in keys else "utc"
    epoch_ns = None
    if (epoch := keys.get("epoch")) is not None:
        try:
            epoch_ns = instant_ns(epoch.word())
        except (ValueError, OverflowError) as error:
            raise epoch.wrong("an instant such as 2024-03-20T12:00:00Z") from error
    if scale == "epoch" and epoch_ns is None:
        raise ValueError(f"{entry.name}: scale epoch given, expected epoch with the instant from which times count")
    return TimeForm(columns, unit, scale, epoch_ns)
