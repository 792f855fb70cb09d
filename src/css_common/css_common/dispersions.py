# SPDX-License-Identifier: Apache-2.0
"""What a mission draws for each of its cases: any parameter by its name and a distribution (section `dispersions`).

    dispersions:
      dynamics: {spacecraft.inertia: "normal:0.05"}     # the true one; what flight software knows stays
      wheels.max_torque: "uniform:0.02:0.03"            # of all that read it
      cells.normals.4: "normal:0.0:0.01"                # one number of a list
      css_array.noise: "lognormal:0.3"
    sampling: {method: lhs, cases: 200}

A key is that of `--set`. A list is drawn as a whole: relative distributions scale all of it by one factor, others give
each number the same value. `.K` after the key draws number K alone, `.each` every number by itself; of a symmetric
matrix those across the diagonal are one. What is drawn depends on the seed, the case and the parameter's own name
(and where draws are spread evenly, on the number of cases), not on what else is dispersed.
"""

import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from css_common.distributions import Distribution, distribution
from css_common.schema import Parameter, ParameterError, shown

SECTION = "dispersions."
"""Beginning of the keys of a mission's dispersions."""

EACH = "each"
_FIXED = ("mission.", "graph.", "lockstep.", "io.", "measures.", "sampling.", SECTION)
_NUMBERS = ("real", "reals", "integer", "integers")

Find = Callable[[str], tuple[str | None, Parameter[Any], Any]]
"""Node of a key (None: it is shared), its specification and the mission's own value in canonical form."""


class Dispersion(NamedTuple):
    """One parameter that is drawn.

    Attributes:
        key: of the parameter, as `--set` has it.
        node: whose it is; None: it is shared.
        elements: numbers of a list that are drawn together, one group for each draw; empty: the whole value, in one.
        named: as it was written, with `.K` or `.each`.
        distribution: what it is drawn from.
    """

    key: str
    node: str | None
    elements: tuple[tuple[int, ...], ...]
    named: str
    distribution: Distribution

    @property
    def draws(self) -> int:
        """How many numbers a case draws for it."""
        return len(self.elements) or 1

    def dimensions(self) -> list[tuple[int, int]]:
        """Index and step of each of its draws in its random stream: functions of its name alone."""
        name = zlib.crc32(self.key.encode())
        if not self.elements:
            return [(name, 0)]
        return [(name, 1 + elements[0]) for elements in self.elements]


def text_parameter(key: str) -> Parameter[Any] | None:
    """Specification of a key below `dispersions`, for those who override it; None: it is another key."""
    return Parameter(key, "text", "", "", "distribution of a parameter") if key.startswith(SECTION) else None


def dispersions_of(raw: Mapping[str, Any], find: Find) -> tuple[Dispersion, ...]:
    """The dispersions of a mission, by name.

    Args:
        raw: flat parameters below `dispersions`.
        find: looks a key up; raises ParameterError or a mission's error for one that there is not.

    Raises:
        ParameterError: one is wrong.
    """
    found = [_dispersion(name, raw[name], find) for name in sorted(raw)]
    seen: dict[tuple[str, int], str] = {}
    for one in found:
        for element in [e for group in one.elements for e in group] or range(_length(find(one.key)[2])):
            other = seen.setdefault((one.key, element), one.named)
            if other != one.named:
                raise ParameterError(f"{SECTION}{one.named}: {other} draws the same number, expected one of the two")
    return tuple(found)


def _length(value: Any) -> int:
    return len(value) if isinstance(value, list) else 1


def _dispersion(name: str, text: Any, find: Find) -> Dispersion:
    where = f"{SECTION}{name}"
    if name.startswith(_FIXED):
        raise ParameterError(f"{where}: names, times and the graph are the same in all cases and cannot be drawn")
    if not isinstance(text, str):
        raise ParameterError(f"{where}: {shown(text)} given, expected a distribution such as normal:0.05")
    key, element = name, ""
    head, _, last = name.rpartition(".")
    if last == EACH or last.isdecimal():
        key, element = head, last
    node, parameter, value = find(key)
    try:
        drawn = distribution(text)
    except ValueError as error:
        raise ParameterError(f"{where}: {shown(text)} given, expected {error}") from error
    dispersion = Dispersion(key, node, _elements(where, element, parameter, value), name, drawn)
    _check(where, dispersion, parameter, value)
    return dispersion


def _elements(where: str, element: str, parameter: Parameter[Any], value: Any) -> tuple[tuple[int, ...], ...]:
    if not element:
        return ()
    if not parameter.is_array:
        raise ParameterError(f"{where}: {parameter.name} is one value, expected no .{element} after it")
    if element == EACH:
        return _mirrored(value)
    if int(element) >= len(value):
        raise ParameterError(f"{where}: {parameter.name} has {len(value)} numbers, expected .0 to .{len(value) - 1}")
    return (next(group for group in _mirrored(value) if int(element) in group),)


def _mirrored(value: Sequence[Any]) -> tuple[tuple[int, ...], ...]:
    """Numbers of a list one by one; of a symmetric 3x3 matrix those across the diagonal in pairs."""
    if len(value) == 9 and all(value[3 * i + j] == value[3 * j + i] for i in range(3) for j in range(i)):
        return tuple(tuple(sorted({3 * i + j, 3 * j + i})) for i in range(3) for j in range(i, 3))
    return tuple((i,) for i in range(len(value)))


def _check(where: str, one: Dispersion, parameter: Parameter[Any], value: Any) -> None:
    if not one.distribution.words and parameter.kind not in _NUMBERS:
        raise ParameterError(f"{where}: {parameter.name} holds no numbers, expected choice:A:B:...")
    own = _numbers_of(one, value)
    if one.distribution.relative and not any(number != 0.0 and number == number for number in own):
        raise ParameterError(
            f"{where}: {one.distribution.text} is relative to the mission's value, which is "
            f"{shown(value) if len(own) else 'not given'}; expected one with absolute numbers"
        )
    for u in (0.5,) if not one.distribution.words else _middles(len(one.distribution.words)):
        drawn_value(one, parameter, value, [u] * one.draws)


def _middles(count: int) -> Iterator[float]:
    return ((i + 0.5) / count for i in range(count))


def _numbers_of(one: Dispersion, value: Any) -> list[Any]:
    if not isinstance(value, list):
        return [value] if isinstance(value, (int, float)) else []
    wanted = [i for group in one.elements for i in group] or range(len(value))
    return [value[i] for i in wanted if isinstance(value[i], (int, float))]


def drawn_value(one: Dispersion, parameter: Parameter[Any], value: Any, draws: Sequence[float]) -> Any:
    """The value of a case in canonical form.

    Args:
        value: the mission's own.
        draws: numbers above 0 and below 1, one for each of `dimensions`.

    Raises:
        ParameterError: the parameter refuses it.
    """
    whole = parameter.kind in ("integer", "integers")
    if not isinstance(value, list):
        drawn: Any = _one(one, parameter, value, draws[0], whole)
    else:
        drawn = list(value)
        for group, u in zip(one.elements or (tuple(range(len(value))),), draws, strict=True):
            for i in group:
                drawn[i] = _one(one, parameter, value[i], u, whole)
    return replace(parameter, name=f"{SECTION}{one.named}").check(drawn)


def _one(one: Dispersion, parameter: Parameter[Any], value: Any, u: float, whole: bool) -> Any:
    drawn = one.distribution.draw(u, value)
    if one.distribution.words:
        return _element(parameter).parse(drawn)
    return round(drawn) if whole else float(drawn)


def _element(parameter: Parameter[Any]) -> Parameter[Any]:
    """What one value of a list must be."""
    single = {"reals": "real", "integers": "integer", "texts": "text"}.get(parameter.kind, parameter.kind)
    return replace(parameter, kind=single, length=None, columns=None)


def in_words(dispersions: Iterable[Dispersion]) -> list[str]:
    """One line each."""
    return [f"{one.named} {one.distribution.text}" for one in dispersions]
