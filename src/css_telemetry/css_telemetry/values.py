# SPDX-License-Identifier: Apache-2.0
"""Numbers in the fields of a table, strict: what is no number is none, and is counted."""

import math
import re
from collections.abc import Sequence

import numpy as np

from css_telemetry.faults import Broken

MISSING = frozenset(["", "nan", "na", "n/a", "#n/a", "null", "none", "nil", "-", "--", "<na>", "nat", "?"])
"""Fields, in small letters, that say that a value is missing."""

_NUMBER_FORM = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_NUMBER = re.compile(_NUMBER_FORM, re.ASCII)
# one pass over a whole column instead of one for each of its fields
_NUMBERS = re.compile(rf"(?:{_NUMBER_FORM}\n)*", re.ASCII)

Column = Sequence[str] | np.ndarray
"""The values of a column as they stand in the table: texts, or numbers of files that have types."""


def plain_number(text: str) -> float:
    """The value of a decimal number; infinity for any other text, such as 0x10, 1_000 or inf."""
    return float(text) if _NUMBER.fullmatch(text) else math.inf


def is_number(text: str) -> bool:
    """Whether a text is a decimal number."""
    return _NUMBER.fullmatch(text) is not None


def numbers_of(column: Column, name: str, decimal_comma: bool = False) -> tuple[np.ndarray, list[tuple[int, Broken]]]:
    """Numbers of a column; NaN where they are missing or none.

    Args:
        column: (K,) fields.
        name: of the column, for messages.
        decimal_comma: numbers have a comma in the place of the point.

    Returns:
        (K,) values, and index and fault of each field that holds something else.
    """
    if isinstance(column, np.ndarray):
        return _typed(column, name)
    texts = [text.replace(",", ".") for text in column] if decimal_comma else column
    joined = "\n".join(texts) + "\n"
    if _NUMBERS.fullmatch(joined):
        values = np.fromiter(map(float, texts), float, len(texts))
        if np.all(np.isfinite(values)):
            return values, []
    return _one_by_one(texts, column, name)


def _one_by_one(texts: Sequence[str], given: Sequence[str], name: str) -> tuple[np.ndarray, list[tuple[int, Broken]]]:
    values = np.full(len(texts), math.nan)
    faults = []
    for index, text in enumerate(texts):
        value = plain_number(text)
        if math.isfinite(value):
            values[index] = value
        elif text.lower() not in MISSING:
            faults.append((index, Broken("no number", f"column {name}: {given[index]!r} found, expected a number")))
    return values, faults


def _typed(column: np.ndarray, name: str) -> tuple[np.ndarray, list[tuple[int, Broken]]]:
    if column.dtype.kind not in "biuf":
        fault = Broken("no number", f"column {name}: {column.dtype} found, expected numbers")
        return np.full(len(column), math.nan), [(index, fault) for index in range(len(column))]
    values = column.astype(float)
    infinite = np.flatnonzero(np.isinf(values))
    values[infinite] = math.nan
    fault = Broken("no number", f"column {name}: infinity found, expected a number")
    return values, [(int(index), fault) for index in infinite]
