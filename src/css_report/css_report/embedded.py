# SPDX-License-Identifier: Apache-2.0
"""Data inside a page: JSON in which long series are the bytes of their numbers, which plotly reads as they are."""

import base64
import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

_KINDS = {"float64": "f8", "float32": "f4", "int32": "i4", "uint8": "u1", "int8": "i1", "int16": "i2", "uint16": "u2"}


def embedded_json(value: Any) -> str:
    """A value as JSON that can stand in a script element, whatever texts are in it."""
    text = json.dumps(_plain(value), allow_nan=False, separators=(",", ":"), ensure_ascii=False)
    # neither an end tag nor a comment may begin inside
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def decoded(value: Mapping[str, Any]) -> np.ndarray:
    """The numbers of a series that `embedded_json` wrote."""
    numbers = np.frombuffer(base64.b64decode(value["bdata"]), dtype=f"<{value['dtype']}")
    shape = value.get("shape")
    return numbers if shape is None else numbers.reshape([int(n) for n in shape.split(",")])


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return _bytes_of(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, str) or value is None:
        return value
    if isinstance(value, Sequence):
        return [_plain(inner) for inner in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value


def _bytes_of(numbers: np.ndarray) -> Any:
    kind = _KINDS.get(numbers.dtype.name)
    if kind is None:
        return [_plain(inner) for inner in numbers.tolist()]
    data = np.ascontiguousarray(numbers, dtype=f"<{kind}").tobytes()
    series = {"dtype": kind, "bdata": base64.b64encode(data).decode()}
    if numbers.ndim > 1:
        series["shape"] = ",".join(map(str, numbers.shape))
    return series
