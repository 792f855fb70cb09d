# SPDX-License-Identifier: Apache-2.0
"""Parameters as data: one table serves declaration, documentation, validation and `ros2 param set`.

A table is a tuple of specifications made by `real`, `integer`, `flag`, `choice`, `text`, `reals`, `integers` and
`texts`. Names are dotted (`cells.normals`), units stand in the table, angles that people write end in `_deg`.
Arrays of rows are flat in a file (ROS parameters know no matrices) and come out as (N, columns) float64 arrays.
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from operator import attrgetter
from types import SimpleNamespace
from typing import Any, Generic, TypeVar

import numpy as np

from css_common.parameter_words import word

_LONGEST_NAME = 100  # [characters] of a name that is compared and shown whole
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]")


T = TypeVar("T")


class ParameterError(ValueError):
    """A parameter that is unknown, of the wrong kind, out of range or in conflict with another."""


@dataclass(frozen=True)
class Parameter(Generic[T]):
    """Specification of one parameter; made by the functions below. `T` is what algorithms see of its value."""

    name: str
    kind: str
    default: Any
    unit: str
    description: str
    low: float | None = None
    high: float | None = None
    open_low: bool = False
    choices: tuple[str, ...] = ()
    length: int | None = None
    columns: int | None = None
    tunable: bool = False
    example: str = ""  # what a file may say, of a parameter that has no default but an empty one

    @property
    def is_array(self) -> bool:
        """True for the kinds that hold several values."""
        return self.kind in ("reals", "integers", "texts")

    def expectation(self) -> str:
        """What a right value looks like, for error messages and documentation."""
        noun = {
            "real": "a number written with a point",
            "integer": "a whole number",
            "flag": "true or false",
            "text": "a text",
            "choice": "one of " + ", ".join(self.choices),
            "reals": "a list of numbers written with points",
            "integers": "a list of whole numbers",
            "texts": "a list of texts",
        }[self.kind]
        unit = f" [{self.unit}]" if self.unit not in ("", "-") else ""
        return ", ".join(filter(None, (f"{noun}{unit}", self._bounds(), self._size())))

    def _bounds(self) -> str:
        """Within what a number must lie, in words."""
        bounds = []
        if self.low is not None:
            bounds.append(f"{'above' if self.open_low else 'at least'} {_number(self.low)}")
        if self.high is not None:
            bounds.append(f"at most {_number(self.high)}")
        return " and ".join(bounds)

    def _size(self) -> str:
        """How many values a list must have, in words."""
        if self.length is not None:
            return f"{self.length} values"
        return f"rows of {self.columns} values" if self.columns is not None else ""

    def check(self, value: Any) -> Any:
        """The value in its canonical Python form (list elements included).

        Raises:
            ParameterError: naming the parameter, the value and what was expected of it: its kind when that is wrong,
                else what the value breaks.
        """
        try:
            return self._converted(value)
        except TypeError as error:
            raise ParameterError(f"{self.name}: {shown(value)} given, expected {self.expectation()}") from error
        except ValueError as error:
            raise ParameterError(f"{self.name}: {shown(value)} given, expected {error}") from error

    def _converted(self, value: Any) -> Any:
        if not self.is_array:
            return self._scalar(self.kind, value)
        if isinstance(value, (str, bytes)) or not isinstance(value, Iterable):
            raise TypeError
        single = {"reals": "real", "integers": "integer", "texts": "text"}[self.kind]
        values = [self._scalar(single, item) for item in value]
        if self.example and not values:
            return values
        if (self.length is not None and len(values) != self.length) or (self.columns and len(values) % self.columns):
            raise ValueError(f"{self._size()}, not {len(values)}")
        return values

    def _scalar(self, kind: str, value: Any) -> Any:
        if kind == "flag":
            if not isinstance(value, bool):
                raise TypeError
            return value
        if kind in ("text", "choice"):
            if not isinstance(value, str) or (kind == "choice" and value not in self.choices):
                raise TypeError
            if _CONTROL.search(value):
                raise ValueError("one line without control characters")
            return value
        if isinstance(value, bool):
            raise TypeError
        if self.example and kind == "real" and isinstance(value, float) and value != value:
            return math.nan
        return self._in_bounds(_whole(value) if kind == "integer" else _real(value))

    def _in_bounds(self, number: Any) -> Any:
        below = self.low is not None and (number < self.low or (self.open_low and number == self.low))
        if below or (self.high is not None and number > self.high):
            unit = f" [{self.unit}]" if self.unit not in ("", "-") else ""
            raise ValueError(f"{'each ' if self.is_array else ''}{self._bounds()}{unit}")
        return number

    def parse(self, text: str) -> Any:
        """The checked value of a command-line text, in the words of a file; numbers may be written without a point.

        Raises:
            ParameterError: the text is no such value.
        """
        if self.is_array:
            inner = text.strip().removeprefix("[").removesuffix("]").strip()
            items = [item.strip() for item in inner.split(",")] if inner else []
        else:
            items = [text.strip()]
        if self.kind == "texts":
            items = [item.strip("'\"") for item in items]  # as in a file
        base = {"reals": "real", "integers": "integer", "texts": "text"}.get(self.kind, self.kind)
        values = items if base in ("text", "choice") else [word(item) if item else item for item in items]
        if base == "real":
            values = [float(value) if type(value) is int else value for value in values]
        return self.check(values if self.is_array else values[0])

    def shaped(self, value: Any) -> Any:
        """What algorithms see: numeric lists as float64 or int64 arrays, rows as (N, columns)."""
        if self.kind == "reals":
            array = np.array(value, dtype=np.float64)
            return array.reshape(-1, self.columns) if self.columns else array
        if self.kind == "integers":
            return np.array(value, dtype=np.int64)
        return value


def shown(value: Any) -> str:
    """A value as messages show it: on one line, its end cut off when it is long."""
    text = repr(value[:100] if isinstance(value, (str, list)) else value)
    return text if len(text) <= 60 else text[:57] + "..."


def _number(limit: float) -> str:
    return str(limit) if isinstance(limit, int) else f"{limit:g}"


def _whole(value: Any) -> int:
    if not isinstance(value, (int, np.integer)):
        raise TypeError
    if not -(2**63) <= value < 2**63:
        raise ValueError("a whole number of 64 bits, as a ROS parameter holds it")
    return int(value)


def _real(value: Any) -> float:
    # ROS refuses `1` where a double is declared; so do we, so that a file means the same to every reader
    if not isinstance(value, (float, np.floating)):
        raise TypeError
    if not math.isfinite(value):
        raise ValueError("a finite number")
    return float(value)


def real(
    name: str,
    default: float | None,
    unit: str,
    description: str,
    *,
    low: float | None = None,
    high: float | None = None,
    open_low: bool = False,
    tunable: bool = False,
    example: str = "",
) -> Parameter[float]:
    """A number. `open_low` excludes the lower bound itself; `tunable` allows a change in flight.

    With an `example` in the place of the default, whoever needs the parameter asks for it, and it is NaN till then.
    """
    value = math.nan if default is None else float(default)
    return Parameter(
        name, "real", value, unit, description, low, high, open_low=open_low, tunable=tunable, example=example
    )


def integer(
    name: str,
    default: int,
    unit: str,
    description: str,
    *,
    low: int | None = None,
    high: int | None = None,
    tunable: bool = False,
) -> Parameter[int]:
    """A whole number."""
    return Parameter(name, "integer", default, unit, description, low, high, tunable=tunable)


def flag(name: str, default: bool, description: str, *, tunable: bool = False) -> Parameter[bool]:
    """True or false."""
    return Parameter(name, "flag", default, "-", description, tunable=tunable)


def choice(
    name: str, default: str, choices: tuple[str, ...], description: str, *, tunable: bool = False, example: str = ""
) -> Parameter[str]:
    """One of a few words; with an `example` the default is that for none of them."""
    return Parameter(name, "choice", default, "-", description, choices=choices, tunable=tunable, example=example)


def text(name: str, default: str, description: str, *, example: str = "") -> Parameter[str]:
    """A text; with an `example` the default is that for none."""
    return Parameter(name, "text", default, "-", description, example=example)


def reals(
    name: str,
    default: Iterable[float],
    unit: str,
    description: str,
    *,
    length: int | None = None,
    columns: int | None = None,
    low: float | None = None,
    high: float | None = None,
    open_low: bool = False,
    tunable: bool = False,
    example: str = "",
) -> Parameter[np.ndarray]:
    """Several numbers: of a given `length`, or rows of `columns` each; bounds hold for each.

    With an `example` there is no default: whoever needs the parameter asks for it, and none are its numbers till then.
    """
    return Parameter(
        name,
        "reals",
        [float(v) for v in default],
        unit,
        description,
        low,
        high,
        open_low=open_low,
        length=length,
        columns=columns,
        tunable=tunable,
        example=example,
    )


def integers(name: str, default: Iterable[int], unit: str, description: str, **limits: Any) -> Parameter[np.ndarray]:
    """Several whole numbers."""
    return Parameter(name, "integers", list(default), unit, description, **limits)


def texts(name: str, default: Iterable[str], description: str) -> Parameter[list[str]]:
    """Several texts."""
    return Parameter(name, "texts", list(default), "-", description)


Table = tuple[Parameter[Any], ...]


class Values(SimpleNamespace):
    """Checked values of a table by attribute, `values.cells.normals`, or typed by parameter, `values[NORMALS]`."""

    def __getitem__(self, parameter: Parameter[T]) -> T:
        value: T = attrgetter(parameter.name)(self)
        return value

    def __contains__(self, parameter: Parameter[Any]) -> bool:
        """Whether it is in the table."""
        at: Any = self
        for name in parameter.name.split("."):
            if not hasattr(at, name):
                return False
            at = getattr(at, name)
        return True

    def items(self, prefix: str = "") -> Iterator[tuple[str, Any]]:
        """Dotted names and values."""
        for key, value in vars(self).items():
            if isinstance(value, Values):
                yield from value.items(f"{prefix}{key}.")
            else:
                yield f"{prefix}{key}", value


def nested(flat: Mapping[str, Any]) -> Values:
    """`Values` of dotted names."""
    root = Values()
    for name, value in flat.items():
        *path, leaf = name.split(".")
        at = root
        for part in path:
            if not hasattr(at, part):
                setattr(at, part, Values())
            at = getattr(at, part)
        setattr(at, leaf, value)
    return root


def checked_values(table: Iterable[Parameter], given: Mapping[str, Any]) -> dict[str, Any]:
    """Canonical values of a whole table: what is given, checked, and the defaults for the rest.

    Raises:
        ParameterError: a name that the table does not have, or a value that its specification refuses.
    """
    specifications = {p.name: p for p in table}
    for name in given:
        if name not in specifications:
            raise ParameterError(unknown_name(name, specifications))
    return {name: p.check(given.get(name, p.default)) for name, p in specifications.items()}


def shaped_values(table: Iterable[Parameter], canonical: Mapping[str, Any]) -> Values:
    """`Values` as algorithms want them, of canonical values."""
    return nested({p.name: p.shaped(canonical[p.name]) for p in table})


def default_values(table: Iterable[Parameter], **changes: Any) -> Values:
    """`Values` of a table's defaults; `changes` by dotted name with `__` for the dot (`cells__normals=...`)."""
    table = tuple(table)
    given = {name.replace("__", "."): value for name, value in changes.items()}
    return shaped_values(table, checked_values(table, given))


def missing(table: Iterable[Parameter], values: Values, needed: Iterable[str]) -> Iterator[str]:
    """What is needed and has not been given, one message each, with an example."""
    specifications = {p.name: p for p in table}
    for name in needed:
        p = specifications[name]
        if not _is_given(p, values[p]):
            some = replace(p, choices=tuple(word for word in p.choices if word != p.default))
            yield f"{name}: missing, expected {some.expectation()}, for instance {p.example}"


def _is_given(p: Parameter[Any], value: Any) -> bool:
    if isinstance(value, str):
        return bool(value != p.default)
    return not math.isnan(value) if isinstance(value, float) else bool(np.size(value))


def unknown_name(name: str, known: Iterable[str]) -> str:
    """Message for an unknown name, with the nearest known one."""
    near = nearest(name, known)
    plain = name and name.isprintable() and len(name) <= _LONGEST_NAME
    return f"{name if plain else shown(name)}: unknown" + (f"; did you mean {near}?" if near else "")


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name that a wrong one was probably meant to be; None when none is like it."""
    # the comparison takes a time that grows with the square of the length
    near = get_close_matches(name, list(known), n=1) if len(name) <= _LONGEST_NAME else []
    return near[0] if near else None
