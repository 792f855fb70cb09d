# SPDX-License-Identifier: Apache-2.0
"""The faults of one case, of the lines that a node has: those that are drawn, drawn; and who tells which of them act.

A draw is a function of seed, case and the text of its line, so that a fault that is added or taken away in flight
changes no other.
"""

import math
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from css_common.codec import Sample
from css_common.fault_lines import FaultKind, Units, parse_line
from css_common.random_streams import RandomKey, Stream, uniform4

if TYPE_CHECKING:
    from css_common.component import Component

NEVER = 2**62
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

    def acts(self, step: int) -> bool:
        """Whether it acts at a control cycle."""
        return self.first_step <= step < self.end_step


class Seed(NamedTuple):
    """What the draws of a line hang on."""

    key: RandomKey
    line: int

    def draws(self, row: int) -> tuple[float, float, float, float]:
        """Four of its uniform draws."""
        return uniform4(self.key, Stream.FAULT, row, _OF_A_CASE | self.line >> 1)


def _as_it_is(fault: CaseFault, seed: Seed) -> CaseFault:
    return fault


class CaseFaults:
    """The faults of one case while the lines of its node change.

    A line is parsed and drawn when it comes, not again with each that follows, or so many that are injected would cost
    the square of their number.
    """

    def __init__(
        self,
        kinds: Sequence[FaultKind],
        units: Units,
        sorts: Mapping[str, int],
        key: RandomKey,
        period: float,
        drawn: Callable[[CaseFault, Seed], CaseFault] = _as_it_is,
    ) -> None:
        """Begins without any.

        Args:
            kinds: that the units may have.
            units: that may fail.
            sorts: codes of the kinds' sorts.
            key: of the case.
            period: control cycle [s].
            drawn: draws what a kind has drawn for each unit.
        """
        self._kinds, self._units, self._sorts = kinds, units, sorts
        self._key, self._period, self._drawn = key, period, drawn
        self._known: dict[tuple[str, int], tuple[CaseFault, ...]] = {}

    def of(self, lines: list[str]) -> list[CaseFault]:
        """Faults in the order of their lines; as many for all cases, some of which may never act.

        Args:
            lines: checked ones, all that there are: what was known of others is forgotten.
        """
        known, self._known = self._known, {}
        faults: list[CaseFault] = []
        seen: Counter[str] = Counter()
        for line in lines:
            place = line, seen[line]
            seen[line] += 1
            found = known.get(place)
            self._known[place] = found = self._of(*place) if found is None else found
            faults += found
        return faults

    def _of(self, line: str, before: int) -> tuple[CaseFault, ...]:
        """Faults of a line that so many of the same text stand before."""
        seed = Seed(self._key, zlib.crc32(f"{line} {before}".encode()))
        found = _faults_of(line, self._kinds, self._units, self._sorts, seed, self._period)
        return tuple(self._drawn(fault, seed) for fault in found)


def step_of(time_s: float, period: float) -> int:
    """First control cycle at or after a time; the slack is for times like 0.3 / 0.1."""
    return NEVER if math.isinf(time_s) else math.ceil(time_s / period - 1e-6)


def _faults_of(
    text: str, kinds: Sequence[FaultKind], units: Units, sorts: Mapping[str, int], seed: Seed, period: float
) -> Iterator[CaseFault]:
    line = parse_line(text, kinds, units)
    occurs, which, when, _ = seed.draws(0)
    late = when * line.within_s
    first, end = step_of(line.start_s + late, period), step_of(line.end_s + late, period)
    if occurs >= line.chance:
        first = end = NEVER
    scaled = tuple(x * v.factor * period**v.cycles for x, v in zip(line.values, line.kind.values, strict=True))
    for unit in (line.units[int(which * len(line.units))],) if line.drawn else line.units:
        yield CaseFault(sorts[line.kind.sort], unit, line.kind.code, line.values, scaled, first, end)


class Teller:
    """Tells on a topic which faults act, whenever that changes."""

    def __init__(self, before: "Teller | None" = None) -> None:
        """Begins, or goes on after what one told `before` whose node begins anew."""
        # those of the last message; None: nobody has told any yet
        self._told: tuple[CaseFault, ...] | None = before._told if before is not None else None

    def memory(self) -> Any:
        """All that the coming messages hang on, for `recall`."""
        return self._told

    def recall(self, memory: Any) -> None:
        """Goes back to a memory."""
        self._told = memory

    def told(self, component: "Component", key: str, stamp_ns: int, faults: Sequence[CaseFault]) -> dict[str, Sample]:
        """A message of the faults that act at a stamp, if they are others than those of the last message.

        Args:
            component: whose output `key` is the topic; it may have none.
            faults: all that may act.
        """
        if key not in component.frames or not (faults or self._told or self._told is None):
            return {}
        step = component.step_of(stamp_ns)
        if self._told is None and step == 0:
            self._told = ()
        # one that begins later, restarted perhaps, may follow messages that are true no more
        acting = tuple(fault for fault in faults if fault.acts(step))
        if acting == self._told:
            return {}
        self._told = acting
        period = component.period_ns * 1e-9

        def column(name: str) -> np.ndarray:
            return np.array([getattr(fault, name) for fault in acting], np.uint32)

        table = [
            (
                *(*fault.values, 0.0, 0.0)[:2],
                fault.first_step * period,
                fault.end_step * period if fault.end_step < NEVER else -1.0,
            )
            for fault in acting
        ]
        return {
            key: component.message(
                key,
                stamp_ns,
                sort=column("sort"),
                unit=column("unit"),
                kind=column("kind"),
                rows=np.array(table, dtype=np.float64).ravel(),
            )
        }
