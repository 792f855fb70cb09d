# SPDX-License-Identifier: Apache-2.0
"""Faults for tests, found by listing the kinds: a new kind is in them by itself."""

from collections import Counter

from css_common.fault_lines import FaultKind
from css_sim.fault_kinds import AXES, KINDS, SORTS

_UNITS = {sort: AXES if sort in ("gyro", "magnetometer") else ("0", "1", "2") for sort in SORTS}
_VALUES = {
    "cell": 0.3, "gyro": 0.5, "magnetometer": 4000.0, "wheel": 0.002, "rod": 0.4, "tachometer": 30.0,
    "share": 0.3, "spell": 0.5, "factor": 0.7, "other": 5.0, "coulomb": 1e-4, "viscous": 1e-5, "wheel limit": 20.0,
    "lowest": 0.1, "highest": 0.9, "delay_us": 300.0, "head rate": 20.0,
}  # fmt: skip


def values_of(kind: FaultKind) -> list[float]:
    """Some values that a kind may have."""
    names = [v.parameter.name for v in kind.values]
    return [_VALUES.get(f"{kind.sort} {name}", _VALUES.get(name, _VALUES.get(kind.sort, 0.0))) for name in names]


FLOWN = tuple(kind for kind in KINDS if kind.sort != "head")
"""Kinds of faults of a spacecraft without slits."""


def every_kind(duration: float, first: float = 0.5, lasts: float = 2.0) -> str:
    """The section `faults` of a mission with one of each kind, spread over its duration, of which some overlap."""
    counts = Counter(kind.sort for kind in FLOWN)
    lines, done = ["    faults:"], Counter[str]()
    for k, kind in enumerate(FLOWN):
        unit = "all" if kind.whole else _UNITS[kind.sort][k % 3]
        begin = first + (duration - first - lasts) * done[kind.sort] / counts[kind.sort]
        done[kind.sort] += 1
        names = [value.parameter.name for value in kind.values]
        given = "".join(f", {name}: {value!r}" for name, value in zip(names, values_of(kind), strict=True))
        what = f"target: {kind.sort}.{unit}, kind: {kind.name}{given}"
        lines.append(f"      {kind.sort}_{kind.name}: {{time: {begin!r}, end: {begin + lasts!r}, {what}}}")
    return "\n".join(lines) + "\n"
