# SPDX-License-Identifier: Apache-2.0
"""What stands between a topic and a component: no message passes that could harm it.

Shared by live nodes and replay. Rejections are counted by kind; the first of each kind is reported.
"""

from collections import Counter
from collections.abc import Callable, Iterable

from css_common.codec import DecodeError, Sample, codec_of
from css_common.component import INERTIAL, Component, Input
from css_common.schema import Values

Report = Callable[[str], None]
HISTORY = 100
"""Messages that a topic holds for a node. One that was restarted answers these again."""

ANSWERED_AGAIN = "answered_again"
"""A restarted sender repeats what its predecessor sent: left out, but no fault."""

_CONFIRMATIONS = 3
CONFIRMATIONS_BACK = 10
_MOST_PENDING = 64
_NEVER = -(2**63)


class StampGuard:
    """Lets stamps pass that go forward by a sane amount.

    A stamp that repeats or goes back is refused, and so is one far ahead: a single damaged stamp must not lock
    out all that follow. When several messages in a row agree on a new time, the sender's clock really was set, or
    a recording started over, and the guard follows. A sender that has taken the place of another repeats stamps
    first, as many as its topics hold for it; that is not its clock.
    """

    def __init__(self, largest_gap_ns: int) -> None:
        self.largest_gap_ns = largest_gap_ns
        self.last: int | None = None
        self._candidate: int | None = None
        self._agreeing = 0
        self._may_repeat = 0

    def expect_repetitions(self) -> None:
        """The next messages come from another sender, which may answer again what has been answered."""
        self._may_repeat = HISTORY
        self._candidate = None

    def refusal(self, stamp_ns: int) -> str | None:
        """Why a stamp is refused (`answered_again`, `stamp_repeated`, `stamp_back`, `stamp_jump`); None: it passes."""
        last = self.last
        if last is None or 0 < stamp_ns - last <= self.largest_gap_ns:
            self.last = stamp_ns
            self._candidate = None
            self._may_repeat = 0
            return None
        if self._may_repeat and stamp_ns <= last:
            self._may_repeat -= 1
            return ANSWERED_AGAIN
        if stamp_ns == last:
            return "stamp_repeated"
        candidate = self._candidate
        if candidate is not None and 0 < stamp_ns - candidate <= self.largest_gap_ns:
            self._agreeing += 1
        else:
            self._agreeing = 1
        self._candidate = stamp_ns
        if self._agreeing > (_CONFIRMATIONS if stamp_ns > last else CONFIRMATIONS_BACK):
            self.last = stamp_ns
            self._candidate = None
            return None
        return "stamp_back" if stamp_ns < last else "stamp_jump"


class Edge:
    """Checks the messages of one input."""

    def __init__(self, source: Input, values: Values, report: Report) -> None:
        """Prepares the checks.

        Args:
            source: the input.
            values: the node's values (section io).
            report: called with one line at the first rejection of each kind.
        """
        self.source = source
        self.codec = codec_of(source.message_type)
        self.accepted = 0
        self.repeated = 0
        self.rejected: Counter[str] = Counter()
        io = values.io
        expected = io.inertial_frame if source.frame == INERTIAL else io.body_frame
        self.frames = frozenset((expected, *io.accepted_frames))
        self.expected_frame = expected
        # a message that is due less often than that must not count as one from another time
        largest_gap = max(io.largest_gap, 2.0 * values.mission.period * source.divider)
        self.guard = StampGuard(round(largest_gap * 1e9))
        self._finite_fields = self.codec.real_fields(source.used)
        self._report = report

    def accept(self, data: bytes) -> Sample | None:
        """The message in `data`, or None when it was rejected."""
        try:
            sample = self.codec.decode(data)
        except DecodeError as error:
            self._reject("malformed", str(error))
            return None
        refusal = self._refusal(sample)
        if refusal is not None:
            if refusal[0] == ANSWERED_AGAIN:
                self.repeated += 1
            else:
                self._reject(*refusal)
            return None
        self.accepted += 1
        return sample

    def begin_again(self) -> None:
        """Another sender takes over: stamps that were answered may come once more, which is no fault."""
        self.guard.expect_repetitions()

    def _refusal(self, sample: Sample) -> tuple[str, str] | None:
        """Kind and detail of what is wrong with a message."""
        for name, length in self.source.lengths.items():
            given = len(getattr(sample, name))
            if given != length:
                return "wrong_length", f"{given} {name} given, expected {length}"
        if sample.frame_id not in self.frames:
            return "wrong_frame", f"frame_id {sample.frame_id!r} given, expected {self.expected_frame!r}"
        bad = self.codec.first_not_finite(self._finite_fields, sample)
        if bad is not None:
            return "not_finite", f"{bad} holds NaN or infinity"
        # last, so that a rejected message does not move the clock that its successors are measured by
        refusal = self.guard.refusal(sample.stamp_ns)
        if refusal is not None:
            return refusal, f"stamp {sample.stamp_ns} ns given, last accepted {self.guard.last} ns"
        return None

    def _reject(self, kind: str, detail: str) -> None:
        self.rejected[kind] += 1
        if self.rejected[kind] == 1:
            self._report(f"{self.source.topic}: {kind}: {detail} (further ones are counted, not reported)")


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
                have a publisher).
        """
        self.inputs = {i.key: i for i in inputs}
        self.awaited = frozenset(awaited)
        self.exact = component.values.io.input_matching == "exact"
        self.deadline_ns = round(component.values.io.deadline * 1e9)
        self.unmatched = 0
        self.set_back = 0
        self._pacing = next(iter(self.inputs), None)
        self._component = component
        self._divided = any(i.divider > 1 for i in self.inputs.values())
        self._speaking = self.awaited  # without optional inputs that let a deadline pass
        self._pending: dict[int, dict[str, Sample]] = {}
        self._latest: dict[str, Sample] = {}
        self._newest: dict[str, int] = {}
        self._done = _NEVER

    def offer(self, key: str, sample: Sample) -> list[tuple[int, dict[str, Sample | None]]]:
        """Takes a message; returns the cycles that are now complete, oldest first."""
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
                return []
            self._begin_anew()
        slots = self._pending.setdefault(stamp, {})
        slots[key] = sample
        if not slots.keys() >= self._due(stamp):
            if len(self._pending) > _MOST_PENDING:
                # the one that waits longest; by stamp, leftovers of a time ahead would push out every new one
                self.unmatched += len(self._pending.pop(next(iter(self._pending))))
            return []
        return [self._complete(stamp)]

    def overdue(self) -> list[tuple[int, dict[str, Sample | None]]]:
        """Cycles that wait for optional inputs alone, oldest first; called at a deadline.

        What is silent now is not waited for again until it speaks: a dead gyro costs one deadline, not one a cycle.
        """
        ready = []
        for stamp in sorted(self._pending):
            slots = self._pending.get(stamp)
            missing = self._due(stamp) - slots.keys() if slots is not None else frozenset()
            if slots is not None and not any(self.inputs[key].required for key in missing):
                self._speaking -= missing
                ready.append(self._complete(stamp))
        return ready

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

    def _begin_anew(self) -> None:
        self._pending.clear()
        self._latest.clear()
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
            self.unmatched += len(self._pending.pop(older))
        self._done = stamp
        return stamp, {key: slots.get(key) for key in self.inputs}

    def _offer_latest(self, key: str, sample: Sample) -> list[tuple[int, dict[str, Sample | None]]]:
        self._latest[key] = sample
        if key != self._pacing:
            return []
        stamp = sample.stamp_ns
        if stamp <= self._done:  # as the edge found, the clock was set back
            self._begin_anew()
            self._latest[key] = sample
        received = {}
        for name, entry in self.inputs.items():
            held = self._latest.get(name)
            fresh = held is not None and abs(stamp - held.stamp_ns) <= self.deadline_ns
            if entry.required and not fresh:
                self.unmatched += 1
                return []
            received[name] = held if fresh else None
        self._done = stamp
        return [(stamp, received)]
