# SPDX-License-Identifier: Apache-2.0
"""Which messages belong together: the inputs of one cycle, by their stamps. Shared by live nodes and replay."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from css_common.codec import Sample
from css_common.component import Component, Cycles, Input
from css_common.edge import HISTORY
from css_common.link import GAP
from css_common.message_columns import Columns

_MOST_PENDING = 2 * HISTORY  # more than the lead of the fastest topic over a node that was restarted
_NEVER = -(2**63)


class Missed(NamedTuple):
    """How often a message was missed, and where first."""

    times: int
    first_ns: int


def _note(notes: dict[str, Missed], topic: str, stamp: int) -> None:
    before = notes.get(topic)
    notes[topic] = Missed(1, stamp) if before is None else Missed(before.times + 1, min(stamp, before.first_ns))


class Matcher:
    """Brings the inputs of one cycle together by their stamps.

    Attributes:
        unmatched: messages that no cycle used.
        set_back: how often time went back and the component began anew.
    """

    def __init__(self, component: Component, inputs: Iterable[Input], awaited: Iterable[str]) -> None:
        """Prepares the matching.

        Args:
            component: whose steps decide which inputs are due, and which begins anew when time goes back.
            inputs: all inputs; the first one paces the cycle when matching by the latest.
            awaited: keys without which an exact cycle does not run (required ones, and optional ones that
                have a publisher), as far as they are heeded.
        """
        self.inputs = {i.key: i for i in inputs}
        self.exact = component.values.io.input_matching == "exact"
        self.unmatched = 0
        self.set_back = 0
        self._present = frozenset(awaited)
        self._pacing = next(iter(self.inputs), None)
        self._component = component
        self._divided = any(i.divider > 1 for i in self.inputs.values())
        self._pending: dict[int, dict[str, Sample]] = {}
        self._latest: dict[str, Sample] = {}
        self._newest: dict[str, int] = {}
        self._held: dict[str, list[Sample]] = {key: [] for key, i in self.inputs.items() if i.held_s > 0.0}
        self._done = _NEVER
        self._missed: dict[str, Missed] = {}
        self._late: dict[str, Missed] = {}
        self.awaited: frozenset[str] = frozenset()
        self._speaking = self.awaited  # without optional inputs that let a deadline pass
        self._heed(self.inputs)

    def retune(self) -> None:
        """Takes over what new values of the component say about deadline and inputs."""
        component = self._component
        self._heed({i.key: i for i in type(component).inputs(component.name, component.values)})

    def _heed(self, inputs: Mapping[str, Input]) -> None:
        """Waits from now on for the inputs that are heeded and present."""
        self.deadline_ns = round(self._component.values.io.deadline * 1e9)
        self._unheeded = frozenset(key for key, source in inputs.items() if not source.heeded)
        awaited = self._present - self._unheeded - self._held.keys()
        self._speaking = (self._speaking & awaited) | (awaited - self.awaited)
        self.awaited = awaited
        for key in self._unheeded:
            self._latest.pop(key, None)

    def offer(self, key: str, sample: Sample) -> list[tuple[int, dict[str, Sample | None]]]:
        """Takes a message; returns the cycles that are now complete, oldest first."""
        if key in self._unheeded:
            return []
        if key in self._held:
            return self._hold(key, sample)
        if sample.frame_id == GAP:
            return self._offer_gap(key, sample)
        if not self.exact:
            return self._offer_latest(key, sample)
        stamp = sample.stamp_ns
        went_back = stamp < self._newest.get(key, _NEVER)
        self._newest[key] = stamp
        if key in self.awaited and key not in self._speaking:
            self._speaking |= {key}
        if stamp <= self._done:
            # The edge lets a sender's stamps go back only when its clock was set back. Stamps behind those of the
            # others are late, or come from a clock that never agreed with theirs: neither may stop the cycle.
            if not went_back or self._done - stamp < self.deadline_ns:
                self.unmatched += 1
                _note(self._late, self.inputs[key].topic, stamp)
                return []
            self._begin_anew()
        return self._put(stamp, key, sample)

    def _hold(self, key: str, sample: Sample) -> list[tuple[int, dict[str, Sample | None]]]:
        """Keeps a message for the cycles from its stamp on."""
        if sample.frame_id != GAP:
            self._held[key] = [*self._held[key][-_MOST_PENDING:], sample]
        return []

    def _held_at(self, key: str, stamp: int) -> Sample | None:
        """The newest message of a held input that is not after a stamp, nor too old; older ones are forgotten."""
        kept = self._held[key]
        newest = max((s for s in kept if s.stamp_ns <= stamp), key=lambda s: s.stamp_ns, default=None)
        if newest is None:
            return None
        self._held[key] = [s for s in kept if s.stamp_ns >= newest.stamp_ns]
        return newest if stamp - newest.stamp_ns <= 1e9 * self.inputs[key].held_s else None

    def _put(self, stamp: int, key: str, sample: Sample) -> list[tuple[int, dict[str, Sample | None]]]:
        slots = self._pending.setdefault(stamp, {})
        if key not in slots or slots[key].frame_id != GAP:  # once it was said that nothing comes, it is too late
            slots[key] = sample
        if not slots.keys() >= self._due(stamp):
            if len(self._pending) > _MOST_PENDING:
                # the one that waits longest; by stamp, leftovers of a time ahead would push out every new one
                self._give_up(next(iter(self._pending)))
            return []
        return [self._complete(stamp)]

    def ordinary(
        self, columns: Mapping[str, Columns], places: Mapping[str, np.ndarray]
    ) -> tuple[Cycles, np.ndarray] | None:
        """The cycles of messages of which none would be left over, late or missed; else None.

        Nothing is taken by that; `take` does.

        Args:
            columns: the messages of each input, their stamps rising.
            places: (M,) where in the order of all messages each of them comes, by input.

        Returns:
            the cycles, and with which message each of them is complete.
        """
        heeded = columns.keys() - self._unheeded
        if any(self._held.values()) or self._held.keys() & heeded:
            return None
        if not self.exact or self._pending or not heeded or heeded != self.awaited or self._speaking != self.awaited:
            return None
        stamps = max((columns[key].stamp_ns for key in heeded), key=len)
        if stamps[0] <= self._done:
            return None
        begun, complete = np.full(len(stamps), np.iinfo(np.int64).max), np.full(len(stamps), -1)
        steps = self._component.steps_of(stamps) if self._divided else np.zeros(len(stamps), np.int64)
        rows = {}
        for key in heeded:
            rows[key] = np.flatnonzero(steps % self.inputs[key].divider == 0)
            if not np.array_equal(columns[key].stamp_ns, stamps[rows[key]]):
                return None
            begun[rows[key]] = np.minimum(begun[rows[key]], places[key])
            complete[rows[key]] = np.maximum(complete[rows[key]], places[key])
        pending = np.searchsorted(np.sort(begun), complete) - np.arange(len(stamps))
        if np.any(np.diff(complete, prepend=-1) <= 0) or np.any(pending > _MOST_PENDING):
            return None
        return Cycles(stamps, {key: columns[key] for key in heeded}, rows), complete

    def take(self, columns: Mapping[str, Columns], cycles: Cycles) -> None:
        """Takes messages of ordinary cycles."""
        for key in cycles.columns:
            self._newest[key] = int(columns[key].stamp_ns[-1])
        self._done = int(cycles.stamps_ns[-1])

    def overdue(self) -> list[tuple[int, dict[str, Sample | None]]]:
        """Cycles that wait for inputs that may be silent alone, oldest first; called at a deadline.

        What is silent now is not waited for again until it speaks: a dead gyro costs one deadline, not one a cycle.
        """
        ready = []
        for stamp in sorted(self._pending):
            slots = self._pending.get(stamp)
            missing = self._due(stamp) - slots.keys() if slots is not None else frozenset()
            if slots is not None and all(self.inputs[key].may_be_silent for key in missing):
                self._speaking -= missing
                ready.append(self._complete(stamp))
        return ready

    def released(self) -> list[tuple[int, dict[str, Sample | None]]]:
        """Cycles that have all that is waited for since `retune`, oldest first."""
        ready = [stamp for stamp, slots in self._pending.items() if slots.keys() >= self._due(stamp)]
        return [self._complete(stamp) for stamp in sorted(ready) if stamp in self._pending]

    def _paces_instead(self, stamp: int) -> bool:
        """Whether another input has to pace the cycle, because the one that does has fallen silent and may."""
        pacing = self._latest.get(self._pacing) if self._pacing is not None else None
        silent = pacing is not None and stamp - pacing.stamp_ns > self.deadline_ns
        return silent and self.inputs[str(self._pacing)].outlived and stamp > self._done

    def give_up(self) -> None:
        """Counts what still waits as unmatched: nothing more will come."""
        for stamp in list(self._pending):
            self._give_up(stamp)

    def complaints(self) -> list[str]:
        """Why messages were not used: which partners did not come, or which came too late; a line each."""
        remedy = "io.input_matching=latest pairs messages of different stamps" if self.exact else "see io.deadline"
        lines = [
            f"{topic}: missing in {missed.times} cycles, which did not run, the first at stamp {missed.first_ns} ns "
            f"({remedy})"
            for topic, missed in self._missed.items()
        ]
        lines += [
            f"{topic}: {late.times} messages came when the cycle of their stamp was over, the first at stamp "
            f"{late.first_ns} ns ({remedy})"
            for topic, late in self._late.items()
        ]
        return lines

    def oldest_pending(self) -> int | None:
        """Stamp of the oldest incomplete cycle."""
        return min(self._pending, default=None)

    def missing(self) -> list[str]:
        """Topics that the oldest incomplete cycle still waits for; of all cycles when there is none."""
        if not self._pending:
            return [i.topic for i in self.inputs.values() if i.key in self.awaited]
        oldest = min(self._pending)
        missing = self._due(oldest) - self._pending[oldest].keys()
        return [i.topic for i in self.inputs.values() if i.key in missing]

    def _give_up(self, stamp: int) -> None:
        slots = self._pending.pop(stamp)
        self.unmatched += len(slots)
        for key in self._due(stamp) - slots.keys():
            _note(self._missed, self.inputs[key].topic, stamp)

    def _begin_anew(self) -> None:
        self._pending.clear()
        self._latest.clear()
        self._held = {key: [] for key in self._held}
        self._done = _NEVER
        self.set_back += 1
        self._component.configure()

    def _due(self, stamp: int) -> frozenset[str]:
        if not self._divided:
            return self._speaking
        step = self._component.step_of(stamp)
        return frozenset(key for key in self._speaking if step % self.inputs[key].divider == 0)

    def _complete(self, stamp: int) -> tuple[int, dict[str, Sample | None]]:
        slots = self._pending.pop(stamp)
        for older in [s for s in self._pending if s < stamp]:
            self._give_up(older)
        self._done = stamp
        held = {key: self._held_at(key, stamp) for key in self._held}
        return stamp, {key: slots.get(key) for key in self.inputs} | held

    def _longest_age(self, source: Input) -> int:
        """Age [ns] beyond which a message counts as silent: what comes less often may be older by what it waits."""
        return self.deadline_ns + (source.divider - 1) * self._component.period_ns

    def _offer_gap(self, key: str, sample: Sample) -> list[tuple[int, dict[str, Sample | None]]]:
        """Takes the word for it that no message of a stamp comes, if none has."""
        stamp = sample.stamp_ns
        if stamp <= self._done or key in self._pending.get(stamp, ()):
            return []
        if self.exact:
            return self._put(stamp, key, sample)
        if key != self._pacing:
            return []
        self._done = stamp
        held = {name: self._held_at(name, stamp) for name in self._held}
        return [(stamp, {name: sample if name == key else None for name in self.inputs} | held)]

    def _offer_latest(self, key: str, sample: Sample) -> list[tuple[int, dict[str, Sample | None]]]:
        self._latest[key] = sample
        stamp = sample.stamp_ns
        if key != self._pacing and not self._paces_instead(stamp):
            return []
        if stamp <= self._done:  # as the edge found, the clock was set back
            self._begin_anew()
            self._latest[key] = sample
        received = {}
        for name, entry in self.inputs.items():
            if name in self._held:
                received[name] = self._held_at(name, stamp)
                continue
            held = self._latest.get(name)
            fresh = held is not None and abs(stamp - held.stamp_ns) <= self._longest_age(entry)
            if not fresh and not entry.may_be_silent:
                self.unmatched += 1
                _note(self._missed, entry.topic, stamp)
                return []
            received[name] = held if fresh else None
            if fresh and entry.once:
                del self._latest[name]
        self._done = stamp
        return [(stamp, received)]
