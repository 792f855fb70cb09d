# SPDX-License-Identifier: Apache-2.0
"""Parameters as data: one table serves declaration, documentation, validation and `ros2 param set`.

A table is a tuple of specifications made by `real`, `integer`, `flag`, `choice`, `text`, `reals`, `integers` and
`texts`. Names are dotted (`cells.normals`), units stand in the table, angles that people write end in `_deg`.
Arrays of rows are flat in a file (ROS parameters know no matrices) and come out as (N, columns) float64 arrays.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from types import SimpleNamespace
from typing import Any

import numpy as np


class ParameterError(ValueError):
    """A parameter that is unknown, of the wrong kind, out of range or in conflict with another."""


@dataclass(frozen=True)
class Parameter:
    """Specification of one parameter; made by the functions below."""

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
        bounds = []
        if self.low is not None:
            bounds.append(f"{'above' if self.open_low else 'at least'} {self.low:g}")
        if self.high is not None:
            bounds.append(f"at most {self.high:g}")
        if self.length is not None:
            bounds.append(f"{self.length} values")
        if self.columns is not None:
            bounds.append(f"rows of {self.columns} values")
        unit = f" [{self.unit}]" if self.unit not in ("", "-") else ""
        return f"{noun}{unit}" + (", " + " and ".join(bounds) if bounds else "")

    def check(self, value: Any) -> Any:
        """The value in its canonical Python form (list elements included).

        Raises:
            ParameterError: naming the parameter, the value and what was expected.
        """
        try:
            checked = self._converted(value)
        except (TypeError, ValueError) as error:
            raise ParameterError(f"{self.name}: {_shown(value)} given, expected {self.expectation()}") from error
        return checked

    def _converted(self, value: Any) -> Any:
        if self.is_array:
            if isinstance(value, (str, bytes)) or not isinstance(value, Iterable):
                raise TypeError
            single = {"reals": "real", "integers": "integer", "texts": "text"}[self.kind]
            values = [self._scalar(single, item) for item in value]
            if self.length is not None and len(values) != self.length:
                raise ValueError
            if self.columns is not None and len(values) % self.columns:
                raise ValueError
            return values
        return self._scalar(self.kind, value)

    def _scalar(self, kind: str, value: Any) -> Any:
        if kind == "flag":
            if not isinstance(value, bool):
                raise TypeError
            return value
        if kind in ("text", "choice"):
            if not isinstance(value, str) or (kind == "choice" and value not in self.choices):
                raise TypeError
            return value
        if isinstance(value, bool):
            raise TypeError
        if kind == "integer":
            if not isinstance(value, (int, np.integer)):
                raise TypeError
            number: Any = int(value)
            if not -(2**63) <= number < 2**63:  # what a ROS parameter holds
                raise ValueError
        else:
            # ROS refuses `1` where a double is declared; so do we, so that a file means the same to every reader
            if not isinstance(value, (float, np.floating)):
                raise TypeError
            number = float(value)
        if not math.isfinite(number):
            raise ValueError
        if self.low is not None and (number < self.low or (self.open_low and number == self.low)):
            raise ValueError
        if self.high is not None and number > self.high:
            raise ValueError
        return number

    def parse(self, text: str) -> Any:
        """The checked value of a command-line text; numbers may be written without a point.

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
        values: list[Any] = []
        for item in items:
            try:
                if base == "flag":
                    values.append({"true": True, "false": False, "on": True, "off": False}[item.lower()])
                elif base == "real":
                    values.append(float(item))
                elif base == "integer":
                    values.append(int(item))
                else:
                    values.append(item)
            except (KeyError, ValueError) as error:
                raise ParameterError(f"{self.name}: {text!r} given, expected {self.expectation()}") from error
        return self.check(values if self.is_array else values[0])

    def shaped(self, value: Any) -> Any:
        """What algorithms see: numeric lists as float64 or int64 arrays, rows as (N, columns)."""
        if self.kind == "reals":
            array = np.array(value, dtype=np.float64)
            return array.reshape(-1, self.columns) if self.columns else array
        if self.kind == "integers":
            return np.array(value, dtype=np.int64)
        return value


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def real(
    name: str,
    default: float,
    unit: str,
    description: str,
    *,
    low: float | None = None,
    high: float | None = None,
    open_low: bool = False,
    tunable: bool = False,
) -> Parameter:
    """A number. `open_low` excludes the lower bound itself; `tunable` allows a change in flight."""
    return Parameter(
        name, "real", float(default), unit, description, low, high, open_low=open_low, tunable=tunable
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
) -> Parameter:
    """A whole number."""
    return Parameter(name, "integer", default, unit, description, low, high, tunable=tunable)


def flag(name: str, default: bool, description: str, *, tunable: bool = False) -> Parameter:
    """True or false."""
    return Parameter(name, "flag", default, "-", description, tunable=tunable)


def choice(
    name: str, default: str, choices: tuple[str, ...], description: str, *, tunable: bool = False
) -> Parameter:
    """One of a few words."""
    return Parameter(name, "choice", default, "-", description, choices=choices, tunable=tunable)


def text(name: str, default: str, description: str) -> Parameter:
    """A text."""
    return Parameter(name, "text", default, "-", description)


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
) -> Parameter:
    """Several numbers: of a given `length`, or rows of `columns` each; bounds hold for each."""
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
    )


def integers(name: str, default: Iterable[int], unit: str, description: str, **limits: Any) -> Parameter:
    """Several whole numbers."""
    return Parameter(name, "integers", list(default), unit, description, **limits)


def texts(name: str, default: Iterable[str], description: str) -> Parameter:
    """Several texts."""
    return Parameter(name, "texts", list(default), "-", description)


Table = tuple[Parameter, ...]


class Values(SimpleNamespace):
    """Checked values of a table by attribute: `values.cells.normals`."""

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


def unknown_name(name: str, known: Iterable[str]) -> str:
    """Message for an unknown name, with the nearest known one."""
    near = get_close_matches(name, list(known), n=1)
    shown = name if name and name.isprintable() else repr(name)
    return f"{shown}: unknown" + (f"; did you mean {near[0]}?" if near else "")
