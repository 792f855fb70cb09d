# SPDX-License-Identifier: Apache-2.0
"""Reads entries of a YAML file as texts, and says of each that is wrong where it stands and what would be right."""

import math
from collections.abc import Iterable, Sequence
from typing import Any

import yaml

from css_telemetry.values import plain_number

_LONGEST_SHOWN = 40  # characters of a wrong value in a message
_LENGTH_TOLERANCE = 0.02  # of a unit vector given with two digits


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


def document_of(text: str) -> Any:
    """Texts, lists and dictionaries of a YAML text.

    Raises:
        ValueError: it is no YAML, or a key stands twice.
    """
    try:
        # a BaseLoader subclass: builds texts, lists and dictionaries only
        return yaml.load(text, _TextLoader)
    except (yaml.YAMLError, RecursionError) as error:
        raise ValueError(f"not valid YAML: {error}") from error


def shown(value: Any) -> str:
    """A wrong value for a message, cut off when it is long."""
    text = repr(value)
    return text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}..."


class Entry:
    """The value of a key, with its place in the file. Every method raises ValueError, naming place and expectation."""

    def __init__(self, value: Any, name: str = "") -> None:
        self.value = value
        self.name = name

    def wrong(self, expected: str) -> ValueError:
        """What to raise of a value that is not what was expected."""
        given = "missing" if self.value is None else f"{shown(self.value)} given"
        return ValueError(f"{self.name or 'the file'}: {given}, expected {expected}")

    def children(self, known: Iterable[str], of: str = "keys") -> "Children":
        """The keys below, of which none may be unknown."""
        known = sorted(known)
        if not isinstance(self.value, dict):
            raise self.wrong(f"the {of} {', '.join(known)}")
        for key in self.value:
            if key not in known:
                place = f"{self.name}: " if self.name else ""
                raise ValueError(f"{place}unknown key {shown(key)[1:-1]}, expected {', '.join(known)}")
        return Children(self.value, self.name)

    def number(self) -> float:
        """A finite number."""
        number = plain_number(self.value) if isinstance(self.value, str) else math.inf
        if not math.isfinite(number):
            raise self.wrong("a number")
        return number

    def positive(self) -> float:
        """A number above zero."""
        number = self.number()
        if not number > 0.0:
            raise self.wrong("a number above 0")
        return number

    def word(self, known: Sequence[str] | None = None) -> str:
        """A text that is not empty, one of those known."""
        if not isinstance(self.value, str) or not self.value.strip():
            raise self.wrong("a word" if known is None else f"one of {', '.join(known)}")
        if known is not None and self.value not in known:
            raise self.wrong(f"one of {', '.join(known)}")
        return self.value

    def yes(self) -> bool:
        """True or false."""
        words = {"true": True, "yes": True, "false": False, "no": False}
        if not isinstance(self.value, str) or self.value.lower() not in words:
            raise self.wrong("true or false")
        return words[self.value.lower()]

    def items(self, *lengths: int) -> list["Entry"]:
        """The entries of a list of so many."""
        expected = f"a list of {' or '.join(map(str, lengths))}" if lengths else "a list"
        if not isinstance(self.value, list) or (lengths and len(self.value) not in lengths):
            raise self.wrong(expected)
        return [Entry(value, self.name) for value in self.value]

    def words(self, *lengths: int) -> tuple[str, ...]:
        """A list of so many words."""
        return tuple(entry.word() for entry in self.items(*lengths))

    def numbers(self, *lengths: int) -> tuple[float, ...]:
        """A list of so many numbers."""
        return tuple(entry.number() for entry in self.items(*lengths))

    def unit_vector(self) -> tuple[float, float, float]:
        """A vector given to a few digits, scaled to length 1."""
        if not isinstance(self.value, list) or len(self.value) != 3:
            raise self.wrong("a unit vector [x, y, z]")
        x, y, z = self.numbers(3)
        length = math.hypot(x, y, z)
        if not abs(length - 1.0) <= _LENGTH_TOLERANCE:
            raise ValueError(f"{self.name}: a vector of length {length:.4g} given, expected a unit vector")
        return x / length, y / length, z / length


class Children:
    """The keys of a map."""

    def __init__(self, values: dict[str, Any], name: str) -> None:
        self._values = values
        self._name = name

    def __contains__(self, key: str) -> bool:
        return key in self._values

    def __getitem__(self, key: str) -> Entry:
        name = f"{self._name}.{key}" if self._name else key
        return Entry(self._values.get(key), name)

    def get(self, key: str) -> Entry | None:
        """The entry of a key that may be missing."""
        return self[key] if key in self._values else None
