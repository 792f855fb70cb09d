# SPDX-License-Identifier: Apache-2.0
"""Follows an estimator through its flight where the recording does not tell the step at which something happened.

What flew is known, so the step can be found: the bytes of the replay and those of the flight agree up to it, and from
it on if and only if the same was done there. Two things are looked for: a parameter that somebody set, which has left
a trace on /parameter_events, and a fresh state (a node that was restarted or deactivated and activated).
"""

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from css_bringup.comparison import Comparison
from css_bringup.flight_changes import ParameterChange
from css_common.codec import Sample
from css_common.component import TOLD, Cycles, Received
from css_common.schema import ParameterError
from css_common.stepping import Port, Stepper

_WINDOW_NS = 20_000_000_000
_WINDOW_STEPS = 100
# A fresh state may take some steps to show.
_RECENT = 50
# Bytes that differ now and then, as by rounding, are not worth a search each.
_MOST_FUTILE = 3

Given = list[tuple[Port, Sample, bytes]]
"""Messages of one step."""


class _Step(NamedTuple):
    stamp_ns: int
    received: Received
    before: Any  # snapshot; None: not taken
    given: list[bytes] | None  # what was given and agreed with the flight; None: nothing flew


class Retrace:
    """Steps an estimator as it was stepped in flight.

    Attributes:
        notes: what was found, one line each.
        unplaced: changes whose step was looked for and not found.
    """

    def __init__(
        self,
        stepper: Stepper,
        comparison: Comparison | None,
        changes: Iterable[ParameterChange],
        fresh: Callable[[], Stepper],
    ) -> None:
        """Prepares the search.

        Args:
            stepper: the estimator, at its start.
            comparison: what flew; None: changes are made at the stamps with which they were recorded.
            changes: of parameters, in their order; the steps are not known.
            fresh: a stepper as after a restart of the node.
        """
        self.stepper = stepper
        self.notes: list[str] = []
        self.unplaced: list[ParameterChange] = []
        self._comparison = comparison
        self._changes = deque(changes)
        self._fresh = fresh
        self._history: list[_Step] = []
        self._recent: deque[_Step] = deque(maxlen=_RECENT)
        self._agreed = False
        self._futile = 0
        self._one_by_one = 0
        self._searched = False
        reach = max(_WINDOW_NS, _WINDOW_STEPS * stepper.component.period_ns)
        self._reach_ns = reach if comparison is not None else 0

    def step(self, stamp_ns: int, received: Received) -> Given:
        """The messages of a step, as they flew if anything explains those that flew."""
        if self._changes:
            self._make_overdue_changes(stamp_ns)
        is_near = bool(self._changes) and stamp_ns >= self._changes[0].stamp_ns - self._reach_ns
        before = self.stepper.snapshot() if is_near else None
        given = self._given(stamp_ns, received)
        if self._comparison is None:
            return given
        agrees = self._agrees(given)
        step = _Step(stamp_ns, received, before, [data for *_, data in given] if agrees else None)
        self._recent.append(step)
        if is_near:
            self._history.append(step)
        if agrees is False:
            given = self._explained() or given
        elif agrees:
            self._agreed = True
        return given

    def is_quiet(self, stamp_ns: int) -> bool:
        """No event and no change of parameters is due or looked for up to a stamp."""
        changes = self._changes
        return self.stepper.is_quiet(stamp_ns) and not (changes and stamp_ns >= changes[0].stamp_ns - self._reach_ns)

    def steps(
        self, cycles: Cycles, received: Callable[[int], Received]
    ) -> list[tuple[Port, list[tuple[int, bytes]]]] | None:
        """The messages of many quiet steps, stamp and bytes of each by output; None: they are to be made one by one.

        They are where the component does not offer it, where one fails, and where what flew was something else.
        """
        stepper = self.stepper
        if not stepper.offers_steps or self._one_by_one >= _MOST_FUTILE:
            return None
        before = stepper.snapshot()
        try:
            given = stepper.steps(cycles)
        except Exception:  # told of at the step that raises it
            given = None
        if given is None or not self._note_agreement(cycles, given, received):
            self._one_by_one += 1
            stepper.restore(before)
            return None
        self._one_by_one = 0
        return given

    def _note_agreement(
        self,
        cycles: Cycles,
        given: list[tuple[Port, list[tuple[int, bytes]]]],
        received: Callable[[int], Received],
    ) -> bool:
        """Whether messages are as they flew, where they did; then the last of them are remembered."""
        comparison = self._comparison
        if comparison is None:
            return True
        flew = np.zeros(len(cycles.stamps_ns), np.bool_)
        for _, messages in given:
            flown = [comparison.expected(stamp_ns) for stamp_ns, _ in messages]
            if any(known is not None and known != data for known, (_, data) in zip(flown, messages, strict=True)):
                return False
            flew |= [known is not None for known in flown]
        self._agreed = self._agreed or bool(np.any(flew))
        for step in range(len(flew))[-_RECENT:]:
            of_step = [messages[step][1] for _, messages in given] if flew[step] else None
            self._recent.append(_Step(int(cycles.stamps_ns[step]), received(step), None, of_step))
        return True

    def finish(self) -> None:
        """Says what was never found."""
        self.unplaced += self._changes if self._searched else []

    def _given(self, stamp_ns: int, received: Received) -> Given:
        stepper = self.stepper
        sent = stepper.sent(stamp_ns, stepper.step(stamp_ns, received))
        return [message for message in sent if message[0].key != TOLD]  # the flight's affair

    def _agrees(self, given: Given) -> bool | None:
        """Whether messages are as they flew; None when none of them did."""
        assert self._comparison is not None
        agrees = None
        for port, sample, data in given:
            if port.events:
                continue
            flown = self._comparison.expected(sample.stamp_ns)
            if flown is not None:
                if flown != data:
                    return False
                agrees = True
        return agrees

    # Changes of parameters

    def _make_overdue_changes(self, stamp_ns: int) -> None:
        """Makes changes that have left no trace in the bytes, or whose step was not found."""
        while self._changes and stamp_ns > self._changes[0].stamp_ns + self._reach_ns:
            change = self._changes.popleft()
            self._set(change.values)
            self._history.clear()
            if self._searched:
                self.unplaced.append(change)
                self._searched = False

    def _explained(self) -> Given | None:
        found = None
        if self._history and not self._searched:
            found = self._with_changes()
            self._searched = found is None
        return self._after_restart() if found is None else found

    def _with_changes(self) -> Given | None:
        """The last step's messages with the next changes made where all bytes agree; None: nowhere."""
        steps, latest = self._history, self.stepper.snapshot()
        due = [c for c in self._changes if steps[-1].stamp_ns >= c.stamp_ns - self._reach_ns]
        for count in range(1, len(due) + 1):
            values = {name: value for change in due[:count] for name, value in change.values.items()}
            for first in reversed(range(len(steps))):
                self.stepper.restore(steps[first].before)
                given = self._rerun(steps[first:]) if self._set(values) else None
                if given is not None:
                    self._agreed = True
                    self._accept(due[:count], steps[first].stamp_ns)
                    return given
        self.stepper.restore(latest)
        return None

    def _rerun(self, steps: list[_Step]) -> Given | None:
        """The messages of the last of some steps from the present state on; None when any byte is not as it flew."""
        for step in steps[:-1]:
            again = [data for *_, data in self._given(step.stamp_ns, step.received)]
            if step.given is not None and again != step.given:
                return None
        given = self._given(steps[-1].stamp_ns, steps[-1].received)
        return given if self._agrees(given) else None

    def _accept(self, changes: list[ParameterChange], stamp_ns: int) -> None:
        for change in changes:
            self._changes.popleft()
            self.notes.append(f"{change.text()} was set before stamp {stamp_ns} ns, as the bytes show")
        self._history.clear()

    def _set(self, values: Mapping[str, Any]) -> bool:
        try:
            self.stepper.set_values(values)
        except ParameterError:
            return False
        return True

    # Fresh states

    def _after_restart(self) -> Given | None:
        """The messages of a state that began anew lately, if all since then are as they flew.

        It is looked for where replay and flight agreed before.
        """
        if not self._agreed or self._futile >= _MOST_FUTILE:
            return None
        self._agreed = False
        latest = self.stepper.snapshot()
        self.stepper.component.configure()
        candidates = (self.stepper.snapshot(), self._fresh().snapshot())
        steps = list(self._recent)
        for first in reversed(range(len(steps))):
            # it began with an answer that is known, or nothing tells that it began there
            if steps[first].given is None and first < len(steps) - 1:
                continue
            for candidate in candidates:
                self.stepper.restore(candidate)
                given = self._rerun(steps[first:])
                if given is not None:
                    self._note_restart(steps, first)
                    return given
        self.stepper.restore(latest)
        self._futile += 1
        return None

    def _note_restart(self, steps: list[_Step], first: int) -> None:
        assert self._comparison is not None
        self._agreed = True
        self._futile = 0
        self._history.clear()
        self._recent.clear()
        silent = self._comparison.excuse_before(steps[first].stamp_ns)
        silence = f", after {silent} stamps without an estimate" if silent else ""
        self.notes.append(f"the estimator began anew in flight at stamp {steps[first].stamp_ns} ns{silence}")
