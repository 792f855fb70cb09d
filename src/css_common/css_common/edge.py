# SPDX-License-Identifier: Apache-2.0
"""What stands between a topic and a component: no message passes that could harm it.

Shared by live nodes and replay. Rejections are counted by kind; the first of each kind is reported.
"""

import time
from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from css_common.codec import DecodeError, Sample, codec_of
from css_common.component import INERTIAL, Input
from css_common.link import GAP
from css_common.message_columns import Columns, stack_alike
from css_common.readings import ReadingCheck
from css_common.schema import Values

Report = Callable[[str], None]
HISTORY = 100
"""Messages that a topic holds for a node. One that was restarted answers these again."""

ANSWERED_AGAIN = "answered_again"
"""A restarted sender repeats what its predecessor sent: left out, but no fault."""

REJECTED = ".rejected."
"""Between an input and the kind of refusal, in the names of counters."""
STRANGER = ".stranger."
"""Between a topic and the node that wrote it besides the one that is heard, in the names of counters."""

_CONFIRMATIONS = 3
CONFIRMATIONS_BACK = 10


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
            self.take(stamp_ns)
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

    def are_in_order(self, stamps_ns: np.ndarray) -> bool:
        """Whether each of some stamps (M,) would pass; they are not taken."""
        steps = np.diff(stamps_ns if self.last is None else np.r_[self.last, stamps_ns])
        return bool(np.all((steps > 0) & (steps <= self.largest_gap_ns)))

    def take(self, stamp_ns: int) -> None:
        """Takes some stamps that are in order, of which this is the last."""
        self.last = stamp_ns
        self._candidate = None
        self._may_repeat = 0


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
        self.now_ns: Callable[[], int] = time.time_ns
        self.codec = codec_of(source.message_type)
        self.accepted = 0
        self.repeated = 0
        self.rejected: Counter[str] = Counter()
        io = values.io
        expected = source.sensor_frame or (io.inertial_frame if source.frame == INERTIAL else io.body_frame)
        self.frames = frozenset((expected, *io.accepted_frames))
        self.expected_frame = expected
        # a message that is due less often than that must not count as one from another time
        largest_gap = max(io.largest_gap, 2.0 * values.mission.period * source.divider)
        self.guard = StampGuard(round(largest_gap * 1e9))
        self._finite_fields = [f for f in self.codec.real_fields(source.used) if f.name not in source.readings]
        self._checks = [ReadingCheck(source.topic, name, may_be, report) for name, may_be in source.readings.items()]
        self._incomplete: list[ReadingCheck] = []
        self._report = report

    @property
    def missing(self) -> dict[str, int]:
        """Elements of arrays that counted as missing, by field and kind."""
        return {f"{check.name}.{kind}": count for check in self._checks for kind, count in check.counts.items()}

    def accept(self, data: bytes) -> Sample | None:
        """The message in `data`, or None when it was rejected; a gap passes, whatever its stamp."""
        try:
            sample = self.codec.decode(data)
        except DecodeError as error:
            self._reject("malformed", str(error))
            return None
        if sample.frame_id == GAP:
            return sample
        if self.source.restamped:
            sample.stamp_ns = self.now_ns()
        refusal = self._refusal(sample)
        if refusal is not None:
            self._incomplete.clear()
            if refusal[0] == ANSWERED_AGAIN:
                self.repeated += 1
            else:
                self._reject(*refusal)
            return None
        self.accepted += 1
        if self._incomplete:
            for check in self._incomplete:
                check.clear(getattr(sample, check.name))
            self._incomplete.clear()
        return sample

    def ordinary(self, messages: Sequence[bytes]) -> Columns | None:
        """What some messages hold if each would be accepted as it is, with nothing to count, and all have one layout.

        Nothing is taken by that; `take` does.
        """
        try:
            alike = stack_alike(self.codec, messages)
        except DecodeError:
            return None
        if alike is None or alike.frame_id not in self.frames:
            return None
        columns = alike.columns
        if any(getattr(columns, name).shape[1] != length for name, length in self.source.lengths.items()):
            return None
        if not all(np.all(np.isfinite(getattr(columns, field.name))) for field in self._finite_fields):
            return None
        if not all(check.are_whole(getattr(columns, check.name)) for check in self._checks):
            return None
        return columns if self.guard.are_in_order(columns.stamp_ns) else None

    def take(self, columns: Columns) -> None:
        """Accepts messages that are ordinary."""
        self.accepted += len(columns)
        self.guard.take(int(columns.stamp_ns[-1]))

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
        for check in self._checks:
            values = getattr(sample, check.name)
            if not check.is_whole(values):
                self._incomplete.append(check)
                reason = check.refusal(values)
                if reason is not None:
                    return "not_finite", reason
        # last, so that a rejected message does not move the clock that its successors are measured by
        refusal = self.guard.refusal(sample.stamp_ns)
        if refusal is not None:
            return refusal, f"stamp {sample.stamp_ns} ns given, last accepted {self.guard.last} ns"
        return None

    def _reject(self, kind: str, detail: str) -> None:
        self.rejected[kind] += 1
        if self.rejected[kind] == 1:
            self._report(f"{self.source.topic}: {kind}: {detail} (further ones are counted, not reported)")
