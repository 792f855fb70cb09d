# SPDX-License-Identifier: Apache-2.0
"""Faults for tests, found by listing the kinds: a new kind is in them by itself."""

from collections.abc import Iterator

from css_common.fault_lines import FaultKind
from css_sim.fault_kinds import KINDS, SORTS

NODES = {
    "cell": "css_array",
    "gyro": "gyro",
    "magnetometer": "magnetometer",
    "wheel": "dynamics",
    "rod": "dynamics",
    "tachometer": "dynamics",
}
_UNITS = {sort: ("x", "y", "z") if sort in ("gyro", "magnetometer") else ("0", "1", "2") for sort in SORTS}
_VALUES = {
    "cell": 0.3, "gyro": 0.5, "magnetometer": 4000.0, "wheel": 0.002, "rod": 0.4, "tachometer": 30.0,
    "share": 0.3, "spell": 0.5, "factor": 0.7, "other": 5.0, "coulomb": 1e-4, "viscous": 1e-5, "wheel limit": 20.0,
    "lowest": 0.1, "highest": 0.9,
}  # fmt: skip


def values_of(kind: FaultKind) -> list[float]:
    """Some values that a kind may have."""
    names = [v.parameter.name for v in kind.values]
    return [_VALUES.get(f"{kind.sort} {name}", _VALUES.get(name, _VALUES[kind.sort])) for name in names]


def every_kind(nodes: tuple[str, ...], first: float = 0.5, every: float = 0.7, lasts: float = 2.0) -> Iterator[str]:
    """Overrides of a mission with a fault of each kind, one after the other, of which some overlap."""
    lines: dict[str, list[str]] = {node: [] for node in nodes}
    for k, kind in enumerate(KINDS):
        node = NODES[kind.sort]
        if node in lines:
            unit = "all" if kind.whole else _UNITS[kind.sort][k % 3]
            words = [f"{kind.sort}.{unit}", kind.name, *(f"{v:g}" for v in values_of(kind))]
            begin = first + every * len(lines[node])
            lines[node].append(" ".join([*words, f"from {begin:g} to {begin + lasts:g}"]))
    for node, of_node in lines.items():
        yield f"{node}.faults={','.join(of_node)}"
