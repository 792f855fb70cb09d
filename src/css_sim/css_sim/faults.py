# SPDX-License-Identifier: Apache-2.0
"""The faults of a case, of the lines that a node has: those that are drawn, drawn, as arrays for kernels.

A draw is a function of seed, case and the text of its line, so that a fault that is added or taken away in flight
changes no other.
"""

import math
import zlib
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from css_common.fault_lines import FaultKind, FaultLine, Units, parse_line
from css_common.random_streams import RandomKey, Stream, uniform4
from css_sim import fault_effects as effects
from css_sim.fault_effects import FAULT, NEVER
from css_sim.fault_kinds import SORTS

_OF_A_CASE = 2**31  # index of draws for a whole case, apart from those in flight


class CaseFault(NamedTuple):
    """One fault of one unit in one case."""

    sort: int
    unit: int
    kind: int
    values: tuple[float, ...]  # as its line has them
    scaled: tuple[float, ...]  # as kernels take them
    first_step: int
    end_step: int


def case_faults(
    lines: list[str], kinds: Sequence[FaultKind], units: Units, key: RandomKey, period: float
) -> list[CaseFault]:
    """Faults of one case, in the order of their lines; as many for all cases, some of which may never act.

    Args:
        lines: checked ones.
        period: control cycle [s].
    """
    faults: list[CaseFault] = []
    seen: Counter[str] = Counter()
    for line in lines:
        seed = zlib.crc32(f"{line} {seen[line]}".encode())
        seen[line] += 1
        faults += _faults_of(parse_line(line, kinds, units), key, seed, period)
    return faults


def step_of(time_s: float, period: float) -> int:
    """First control cycle at or after a time; the slack is for times like 0.3 / 0.1."""
    return NEVER if math.isinf(time_s) else math.ceil(time_s / period - 1e-6)


def rows(faults: Sequence[CaseFault]) -> np.ndarray:
    """Array (F,) of FAULT of the faults of one node, whose draws hang on their places among them."""
    table = np.zeros(len(faults), FAULT)
    for place, (row, fault) in enumerate(zip(table, faults, strict=True)):
        row["index"] = (fault.sort << 16) + place
        row["sort"], row["unit"], row["kind"] = fault.sort, fault.unit, fault.kind
        row["value"], row["second"] = (*fault.scaled, 0.0, 0.0)[:2]
        row["first_step"], row["end_step"] = fault.first_step, fault.end_step
        row["held"] = math.nan
    return table


def with_held(table: np.ndarray, before: np.ndarray, anew: Collection[int] = ()) -> np.ndarray:
    """Faults (F,) of FAULT, the frozen ones among them with what they held `before` if they were there.

    Args:
        anew: sorts of units that know nothing of before.
    """
    known = {_identity(row): row["held"] for row in before if row["sort"] not in anew}
    for row in table:
        row["held"] = known.get(_identity(row), math.nan)
    return table


def _identity(row: np.void) -> tuple[int, ...]:
    return tuple(int(row[name]) for name in ("sort", "unit", "kind", "first_step", "end_step"))


def _faults_of(line: FaultLine, key: RandomKey, seed: int, period: float) -> Iterator[CaseFault]:
    occurs, which, when, _ = uniform4(key, Stream.FAULT, 0, _OF_A_CASE | seed >> 1)
    late = when * line.within_s
    first, end = step_of(line.start_s + late, period), step_of(line.end_s + late, period)
    if occurs >= line.chance:
        first = end = NEVER
    units = (line.units[int(which * len(line.units))],) if line.drawn else line.units
    for unit in units:
        code, values = line.kind.code, line.values
        scaled = tuple(x * v.factor * period**v.cycles for x, v in zip(values, line.kind.values, strict=True))
        if code == effects.STUCK_RANDOM:
            u = uniform4(key, Stream.FAULT, 1 + unit, _OF_A_CASE | seed >> 1)[0]
            code, values = effects.STUCK, (values[0] + u * (values[1] - values[0]),)
            scaled = values
        yield CaseFault(SORTS[line.kind.sort], unit, code, values, scaled, first, end)
