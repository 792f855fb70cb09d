# SPDX-License-Identifier: Apache-2.0
"""Faults of sensors and actuators as lines of text, and as the named entries of a mission that lines are made of.

A component states which kinds of faults its units may have (`Component.fault_kinds`) and which units there are; it
takes the faults themselves as the parameter `faults`, a list of lines. A mission says them as entries of its section
`faults`, which become lines of the node that has the target; what injects a fault in flight adds a line.
"""

import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from css_common.schema import Parameter, ParameterError, nearest, real, shown, text, texts

FORM = "TARGET KIND [VALUE ...] [from START] [to END] [chance P] [within SPAN]"
FAULTS = replace(
    texts("faults", (), f"faults of its units, each {FORM}; times in s of the flight"),
    tunable=True,
)

ANY = "any"
ALL = "all"
NAMED_APART = ("message", "clock", "process")
"""Sorts of which every node has units, and no two nodes one of the same name."""
SECTION = "faults."
"""Beginning of the keys of a mission's entries."""

_RANGE = re.compile(r"(\d+)-(\d+)")
_TIMES: dict[str, Parameter[float]] = {
    "from": real("time", 0.0, "s", "when it begins", low=0.0, high=1e9),
    "to": real("end", math.inf, "s", "when it ends; not given: it stays", low=0.0, high=1e9),
    "chance": real("probability", 1.0, "-", "of a case to have it", low=0.0, high=1.0),
    "within": real("within", 0.0, "s", "it begins by up to so much later, drawn for each case", low=0.0, high=1e9),
}
ENTRY: tuple[Parameter[Any], ...] = (
    text("target", "", "what fails, as SORT.UNIT: a unit, a range such as cell.4-7, `all`, or `any`, drawn"),
    text("kind", "", "what it then does"),
    *_TIMES.values(),
)
"""Keys of an entry beside the values of its kind."""


class FaultValue(NamedTuple):
    """A value of a kind of fault, and how kernels take it: times `factor` and the control cycle to a power."""

    parameter: Parameter[float]
    factor: float = 1.0
    cycles: int = 0  # power of the period: 1 for what is given per second, -1 for times
    names_unit: bool = False  # the number of another unit of the sort


class FaultKind(NamedTuple):
    """What units of one sort may do instead of what they should."""

    sort: str  # cell, gyro, wheel, ...
    name: str
    code: int
    values: tuple[FaultValue, ...]
    description: str
    whole: bool = False  # befalls all units of the sort or none


class FaultLine(NamedTuple):
    """One fault; times in seconds after the epoch, `end_s` infinite when it stays."""

    kind: FaultKind
    units: tuple[int, ...]
    drawn: bool  # one of the units, drawn for each case; else all of them
    values: tuple[float, ...]
    start_s: float
    end_s: float
    chance: float
    within_s: float


Units = Mapping[str, Sequence[str]]
"""Sort of a component's units to their names, in the order of their numbers."""


def parse_line(line: str, kinds: Iterable[FaultKind], units: Units) -> FaultLine:
    """The fault of a line.

    Raises:
        ValueError: the line has another form, or there is no such unit or kind; with what would be right.
    """
    words = line.split()
    if len(words) < 2:
        raise ValueError(f"{shown(line)} is no fault, expected {FORM}")
    sort, chosen, drawn = _target(words[0], units)
    kind = _kind(words[1], sort, kinds)
    if kind.whole and (drawn or len(chosen) < len(units[sort])):
        raise ValueError(f"{shown(line)}: {words[0]} given, expected {sort}.{ALL}, the only target of {kind.name}")
    rest = words[2:]
    count = len(kind.values)
    expected = f"{kind.name} with {', '.join(v.parameter.name for v in kind.values)}" if count else kind.name
    try:
        values = tuple(v.parameter.check(float(word)) for v, word in zip(kind.values, rest[:count], strict=True))
        times = {word: _TIMES[word].check(float(value)) for word, value in _pairs(rest[count:])}
    except ParameterError as error:
        raise ValueError(f"{shown(line)}: {error}") from error
    except (KeyError, ValueError) as error:
        raise ValueError(f"{shown(line)} is no fault, expected {expected} in {FORM}") from error
    _check_named(line, kind, values, len(units[sort]))
    start_s, end_s = times.get("from", 0.0), times.get("to", math.inf)
    if not start_s < end_s:
        raise ValueError(f"{shown(line)}: to {end_s:g} given, expected later than {start_s:g}, when it begins")
    return FaultLine(kind, chosen, drawn, values, start_s, end_s, times.get("chance", 1.0), times.get("within", 0.0))


def _check_named(line: str, kind: FaultKind, values: Sequence[float], count: int) -> None:
    """Refuses numbers of units that there are not."""
    for v, value in zip(kind.values, values, strict=True):
        if v.names_unit and value not in range(count):
            given = f"{v.parameter.name} {value:g} given"
            raise ValueError(f"{shown(line)}: {given}, expected a {kind.sort} from 0 to {count - 1}")


def line_of(target: str, kind: str, values: Iterable[float], times: Mapping[str, float]) -> str:
    """The line of a fault; `times` by the words of `FORM`, those that are as usual left out."""
    words = [target, kind, *map(_digits, values)]
    for word, p in _TIMES.items():
        if word in times and times[word] != p.default:
            words += [word, _digits(times[word])]
    return " ".join(words)


def _digits(value: float) -> str:
    return repr(float(value)).removesuffix(".0")


def conflicts(
    lines: list[str],
    kinds: Iterable[FaultKind],
    units: Units,
    name: str = "faults",
    in_force: Collection[str] = (),
) -> Iterable[str]:
    """What is wrong with the lines of a node's parameter, one message each; those in force were looked at before."""
    kinds = tuple(kinds)
    for line in lines:
        if line in in_force:
            continue
        try:
            parse_line(line, kinds, units)
        except ValueError as error:
            yield f"{name}: {error}"


def _pairs(words: Sequence[str]) -> Iterable[tuple[str, str]]:
    if len(words) % 2 or len(set(words[::2])) != len(words[::2]):
        raise ValueError
    return zip(words[::2], words[1::2], strict=True)


def _target(word: str, units: Units) -> tuple[str, tuple[int, ...], bool]:
    """Sort of a target, its units, and whether one of them is drawn."""
    sort, dot, unit = word.partition(".")
    if not dot and sort not in units and len(units) == 1:
        sort, unit = next(iter(units)), word
    if sort not in units:
        raise ValueError(f"{shown(word)}: no such target{_meant(sort, units)}, expected {_targets(units)}")
    names = units[sort]
    if unit in (ALL, ANY) or not (dot or unit):
        return sort, tuple(range(len(names))), unit == ANY
    if unit in names:
        return sort, (names.index(unit),), False
    if found := _RANGE.fullmatch(unit):
        first, last = int(found[1]), int(found[2])
        if first <= last < len(names):
            return sort, tuple(range(first, last + 1)), False
    raise ValueError(f"{shown(word)}: no such target, expected {_targets({sort: names})}")


def _targets(units: Units) -> str:
    """Words for the targets that there are."""
    sorts = []
    for sort, names in units.items():
        if names and all(name.isdecimal() for name in names):
            sorts.append(f"{sort}.0 to {sort}.{len(names) - 1}" if len(names) > 1 else f"{sort}.0")
        else:
            sorts.append(", ".join(f"{sort}.{name}" for name in names))
        sorts[-1] += f", {sort}.{ALL} or {sort}.{ANY}"
    return "; ".join(sorts) or "none, nothing here can fail"


def _kind(name: str, sort: str, kinds: Iterable[FaultKind]) -> FaultKind:
    of_sort = {kind.name: kind for kind in kinds if kind.sort == sort}
    if name not in of_sort:
        raise ValueError(f"{shown(name)}: no fault of a {sort}{_meant(name, of_sort)}, expected {', '.join(of_sort)}")
    return of_sort[name]


def _meant(name: str, known: Iterable[str]) -> str:
    near = nearest(name, known)
    return f"; did you mean {near}?" if near else ""


class Entry(NamedTuple):
    """An entry of a mission's section `faults`, as the node that has its target takes it."""

    name: str
    node: str
    line: str
    time: float


class Host(NamedTuple):
    """A node that faults may be said of."""

    kinds: tuple[FaultKind, ...]
    units: Units


def entries_of(raw: Mapping[str, Any], hosts: Mapping[str, Host]) -> tuple[Entry, ...]:
    """The entries of a mission, in their order.

    Args:
        raw: flat parameters below `faults`.
        hosts: what each node of the graph may have.

    Raises:
        ParameterError: an entry is wrong.
    """
    entries: dict[str, dict[str, Any]] = {}
    for key, value in raw.items():
        name, _, field = key.partition(".")
        entries.setdefault(name, {})[field] = value
    return tuple(_entry(name, fields, hosts) for name, fields in entries.items())


def _entry(name: str, given: Mapping[str, Any], hosts: Mapping[str, Host]) -> Entry:
    where = f"{SECTION}{name}"
    plain = {p.name: p for p in ENTRY}
    for key in ("target", "kind"):
        if key not in given:
            raise ParameterError(f"{where}.{key}: missing, expected {plain[key].description}")
    common = {key: replace(plain[key], name=f"{where}.{key}").check(v) for key, v in given.items() if key in plain}
    node, target = _node_of(common["target"], hosts, where)
    sort = target.partition(".")[0]
    try:
        kind = _kind(common["kind"], sort, hosts[node].kinds)
    except ValueError as error:
        raise ParameterError(f"{where}.kind: {error}") from error
    own = {value.parameter.name: value.parameter for value in kind.values}
    for key in given:
        if key not in plain and key not in own:
            expected = ", ".join((*plain, *own))
            raise ParameterError(f"{where}.{key}: unknown{_meant(key, (*plain, *own))}, expected {expected}")
    for key, p in own.items():
        if key not in given:
            raise ParameterError(f"{where}.{key}: missing, expected {p.expectation()}")
    values = [replace(p, name=f"{where}.{key}").check(given[key]) for key, p in own.items()]
    times = {word: common[p.name] for word, p in _TIMES.items() if p.name in common}
    line = line_of(target, kind.name, values, times)
    try:
        parse_line(line, hosts[node].kinds, hosts[node].units)
    except ValueError as error:
        raise ParameterError(f"{where}: {error}") from error
    return Entry(name, node, line, times.get("from", 0.0))


def _node_of(target: str, hosts: Mapping[str, Host], where: str) -> tuple[str, str]:
    """The node that has a target, and the target there: `NODE/SORT.UNIT`, or `SORT.UNIT` where one node has it."""
    sort, _, unit = target.partition(".")
    having = [name for name, host in hosts.items() if sort in host.units]
    known = [name for name in having if unit in hosts[name].units[sort]]
    if len(having) == 1 or len(known) == 1:
        return (known or having)[0], target
    node, slash, rest = target.partition("/")
    if slash and node in hosts and rest.partition(".")[0] in hosts[node].units:
        return node, rest
    if having and sort in NAMED_APART and unit not in (ALL, ANY):
        names = [name for host in having for name in hosts[host].units[sort]]
        expected = ", ".join(f"{sort}.{name}" for name in names)
        raise ParameterError(f"{where}.target: {shown(target)} given, which does not fly; expected {expected}")
    if having:
        expected = ", ".join(f"{name}/{target}" for name in having)
        raise ParameterError(f"{where}.target: {shown(target)} given, which several nodes have; expected {expected}")
    flown = {f"{name}/{s}" if slash else s: names for name, host in hosts.items() for s, names in host.units.items()}
    flown = {s: names for s, names in flown.items() if s.rpartition("/")[2] not in NAMED_APART}
    raise ParameterError(f"{where}.target: {shown(target)} given, which does not fly; expected {_targets(flown)}")


def entry_parameter(key: str, hosts: Iterable[Host]) -> Parameter[Any] | None:
    """Specification of a key below `faults`, for those who override it; None: no entry has such a key."""
    if not key.startswith(SECTION) or key.count(".") != 2:
        return None
    field = key.rpartition(".")[2]
    # several sorts have values of a name, within bounds of their own: those are checked with the entry
    values = (
        replace(v.parameter, unit="", low=None, high=None, open_low=False)
        for host in hosts
        for kind in host.kinds
        for v in kind.values
    )
    return next((replace(p, name=key) for p in (*ENTRY, *values) if p.name == field), None)
