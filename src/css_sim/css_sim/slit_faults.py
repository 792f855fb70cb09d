# SPDX-License-Identifier: Apache-2.0
"""Faults of the heads of a slit sensor: pulses that do not come, come twice, late, or without a Sun."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from css_common.case_faults import CaseFault, CaseFaults
from css_common.fault_lines import Units
from css_common.mission_section import PERIOD
from css_common.random_streams import RandomKey, Stream, uniform4
from css_common.schema import Values
from css_sensors.slits import HEAD_AZIMUTHS, SLITS_PER_HEAD
from css_sim import faults
from css_sim.fault_effects import DEAD, DOUBLED, DROPPED, LATE, SPURIOUS
from css_sim.fault_kinds import kinds_of

KINDS = kinds_of("head")

_SPURIOUS = 2**20  # index of the draws of pulses without a Sun, after those of the pulses that there are
_MOST = 1000  # of them in a cycle


class Pulse(NamedTuple):
    """One pulse; ordered by time."""

    ticks: int  # whole counts since the epoch
    slit: int
    head: int


class Cycle(NamedTuple):
    """A control cycle in counts of the timer."""

    step: int
    begin: int  # first count of it
    end: int  # first count after it


def units(values: Values) -> Units:
    """The heads that may fail."""
    return {"head": [str(i) for i in range(len(values[HEAD_AZIMUTHS]))]}


def of_case(values: Values, key: RandomKey) -> CaseFaults:
    """The faults of one case, by the lines that there are."""
    return faults.of_case(KINDS, units(values), key, values[PERIOD])


class FaultyHeads:
    """What faults make of the pulses of each cycle; pulses that come later than their cycle are remembered.

    Attributes:
        faults: of the case.
    """

    def __init__(self, failing: Sequence[CaseFault], key: RandomKey, frequency: float) -> None:
        """Begins.

        Args:
            failing: faults of the heads.
            key: of the draws.
            frequency: of the timer [Hz].
        """
        self.faults = failing
        self._key = key
        self._frequency = frequency
        self._coming: list[Pulse] = []

    @property
    def is_needed(self) -> bool:
        """Pulses may not be as healthy heads give them."""
        return bool(self.faults or self._coming)

    def pulses(self, cycle: Cycle, crossings: Sequence[Pulse]) -> list[Pulse]:
        """The pulses that come in a cycle.

        Args:
            cycle: which it is.
            crossings: pulses that healthy heads give in it.
        """
        given = list(crossings)
        for place, fault in enumerate(self.faults):
            if fault.acts(cycle.step):
                given = self._spoiled(fault, place, cycle, given)
        given += self._coming
        self._coming = sorted(pulse for pulse in given if pulse.ticks >= cycle.end)
        return sorted(pulse for pulse in given if pulse.ticks < cycle.end)

    def _spoiled(self, fault: CaseFault, place: int, cycle: Cycle, given: list[Pulse]) -> list[Pulse]:
        if fault.kind == SPURIOUS:
            return given + self._spurious(fault, place, cycle)
        spoiled: list[Pulse] = []
        for index, pulse in enumerate(given):
            if pulse.head != fault.unit:
                spoiled.append(pulse)
                continue
            share = fault.values[0] if fault.kind in (DROPPED, DOUBLED) else 1.0
            chosen = self._draws(cycle.step, place, index)[0] < share
            if fault.kind == LATE:
                spoiled.append(self._later(pulse, fault.values[0]))
            elif fault.kind not in (DEAD, DROPPED) or not chosen:
                spoiled.append(pulse)
                if fault.kind == DOUBLED and chosen:
                    spoiled.append(self._later(pulse, fault.values[1]))
        return spoiled

    def _later(self, pulse: Pulse, delay_us: float) -> Pulse:
        return pulse._replace(ticks=pulse.ticks + round(delay_us * 1e-6 * self._frequency))

    def _spurious(self, fault: CaseFault, place: int, cycle: Cycle) -> list[Pulse]:
        """Pulses of a Poisson process, from any slit."""
        length = cycle.end - cycle.begin
        expected = fault.values[0] * length / self._frequency
        count = _poisson(expected, lambda k: self._draws(cycle.step, place, _SPURIOUS + k)[0])
        found = []
        for k in range(count):
            _, when, which, _ = self._draws(cycle.step, place, _SPURIOUS + k)
            found.append(Pulse(cycle.begin + int(when * length), int(which * SLITS_PER_HEAD), fault.unit))
        return found

    def _draws(self, step: int, place: int, index: int) -> tuple[float, float, float, float]:
        return uniform4(self._key, Stream.HEAD_FAULT, step, (place << 21) + index)


def _poisson(mean: float, uniform: Callable[[int], float]) -> int:
    """A number of events: of waiting times that are exponential, so many fit (Knuth)."""
    waited, count = 0.0, 0
    while count < _MOST:
        waited -= math.log1p(-uniform(count))
        if waited > mean:
            break
        count += 1
    return count
