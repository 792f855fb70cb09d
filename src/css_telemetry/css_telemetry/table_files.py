# SPDX-License-Identifier: Apache-2.0
"""Opens a table, whatever kind of file it is in: text, Parquet or Excel."""

from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from css_recording.errors import BagError
from css_telemetry.description import PLAIN, TableForm
from css_telemetry.long_form import pivoted
from css_telemetry.table_text import Block, Table, name_and_unit, text_table
from css_telemetry.values import Column

if TYPE_CHECKING:
    import pandas as pd

PARQUET = frozenset([".parquet", ".pq"])
EXCEL = frozenset([".xlsx", ".xlsm"])
_BLOCK = 100_000


def open_table(
    path: Path,
    content: bytes,
    names: Collection[str],
    form: TableForm = PLAIN,
    times: tuple[str, ...] = (),
    is_used: Callable[[str], bool] | None = None,
) -> Table:
    """The table in a file.

    Args:
        path: named in messages; its ending tells Parquet (.parquet, .pq) and Excel (.xlsx, .xlsm) from text.
        content: of the file.
        names: columns that are expected.
        form: what is known of it.
        is_used: whether a column of some name is; None: nobody knows yet.
        times: columns of the time, by which lines of a table with one value a line belong together.

    Raises:
        BagError: it cannot be read.
    """
    kind = path.suffix.lower()
    if kind in PARQUET:
        table = _framed(path, _parquet(path, content), 0, ["Parquet"])
    elif kind in EXCEL:
        frame, sheet = _excel(path, content, form.sheet, names)
        table = _framed(path, frame, 1, [f"Excel, sheet {sheet}"])
    else:
        table = text_table(path, content, names, form, is_used)
    return pivoted(table, form, times) if form.long_name else table


def _parquet(path: Path, content: bytes) -> "pd.DataFrame":
    import io

    import pandas as pd
    import pyarrow as pa

    try:
        return pd.read_parquet(io.BytesIO(content)).reset_index(drop=False).drop(columns="index", errors="ignore")
    except (pa.ArrowException, OSError, ValueError) as error:
        raise BagError(f"{path}: cannot be read as Parquet: {' '.join(str(error).split())}") from error


def _excel(path: Path, content: bytes, sheet: str, names: Collection[str]) -> tuple["pd.DataFrame", str]:
    """The sheet that is asked for, else the one whose header has the most of some names; and its name with others."""
    import io
    import zipfile

    import pandas as pd

    try:
        with pd.ExcelFile(io.BytesIO(content), engine="openpyxl") as book:
            known = [str(name) for name in book.sheet_names]
            if sheet and sheet not in known:
                raise BagError(f"{path}: no sheet {sheet}, expected one of {', '.join(known)}")

            def agreement(name: str) -> tuple[int, int]:
                header = [str(column).strip() for column in pd.read_excel(book, sheet_name=name, nrows=0).columns]
                return sum(column in names or name_and_unit(column)[0] in names for column in header), len(header)

            name = sheet or (known[0] if len(known) == 1 else max(known, key=agreement))
            others = f" of {', '.join(known)}" if not sheet and len(known) > 1 else ""
            return pd.read_excel(book, sheet_name=name), name + others
    except (zipfile.BadZipFile, KeyError, ValueError, OSError) as error:
        raise BagError(f"{path}: cannot be read as Excel: {' '.join(str(error).split())}") from error


def _framed(path: Path, frame: "pd.DataFrame", header_line: int, read_as: list[str]) -> Table:
    """A table of a frame, whose lines count from the one behind the header."""
    header = tuple(str(name).strip() for name in frame.columns)
    columns = [_column(frame.iloc[:, index]) for index in range(len(header))]

    def blocks() -> Iterator[Block]:
        for start in range(0, len(frame), _BLOCK):
            end = min(start + _BLOCK, len(frame))
            lines = np.arange(start, end, dtype=np.int64) + header_line + 1
            yield Block(lines, [column[start:end] for column in columns], [])

    units = tuple(name_and_unit(name)[1] for name in header)
    return Table(path, header, header_line, units, False, tuple(read_as), blocks)


def _column(series: "pd.Series[Any]") -> Column:
    """Numbers and instants as they are, else texts."""
    if series.dtype.kind == "M":
        if getattr(series.dtype, "tz", None) is not None:
            series = series.dt.tz_convert("UTC").dt.tz_localize(None)
        if not series.isna().any():
            return series.to_numpy("datetime64[ns]")
    if isinstance(series.dtype, np.dtype) and series.dtype.kind in "biuf":
        return series.to_numpy()
    return ["" if missing else _text(value) for value, missing in zip(series, series.isna(), strict=True)]


def _text(value: Any) -> str:
    if hasattr(value, "isoformat"):
        return value.isoformat()
    return str(value).strip()
