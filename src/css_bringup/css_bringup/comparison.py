# SPDX-License-Identifier: Apache-2.0
"""Estimates of a replay against those that flew, message by message, matched by the stamps of their headers."""

from bisect import bisect_left
from collections.abc import Mapping
from typing import Any

import numpy as np

from css_common.codec import Codec, DecodeError


class Comparison:
    """Bytes that flew against bytes that the replay gives.

    Attributes:
        different: stamps that both have and whose bytes differ, in the order in which they were replayed.
        largest_difference: of any value of any two messages that differ; infinite when one cannot be decoded.
        excused: replayed messages without one that flew, for a known reason.
    """

    def __init__(self, flown: Mapping[int, bytes], codec: Codec) -> None:
        """Takes what flew.

        Args:
            flown: serialised messages by header stamp [ns].
            codec: of their type.
        """
        self.different: list[int] = []
        self.largest_difference = 0.0
        self.excused = 0
        self._codec = codec
        self._flown = dict(flown)
        self._replayed_alone: list[int] = []
        self._compared_ns: list[int] = []
        self._before: tuple[int, bytes] | None = None

    def expected(self, stamp_ns: int) -> bytes | None:
        """What flew at a stamp and has not been compared yet."""
        return self._flown.get(stamp_ns)

    def add(self, stamp_ns: int, data: bytes) -> bool:
        """Takes a message of the replay; whether it is as it flew."""
        flown = self._flown.pop(stamp_ns, None)
        if flown is None and (stamp_ns, data) == self._before:  # which comes twice by a fault of its way
            return True
        self._before = (stamp_ns, data)
        if flown is None:
            self._replayed_alone.append(stamp_ns)
            return False
        self._compared_ns.append(stamp_ns)
        if flown == data:
            return True
        self.different.append(stamp_ns)
        self.largest_difference = max(self.largest_difference, self._difference(flown, data))
        return False

    def excuse_before(self, stamp_ns: int) -> int:
        """Forgives messages of the replay alone between a stamp and the last compared one before; how many."""
        before = bisect_left(self._compared_ns, stamp_ns)
        last_ns = self._compared_ns[before - 1] if before else 0
        kept = [stamp for stamp in self._replayed_alone if not last_ns < stamp < stamp_ns]
        forgiven = len(self._replayed_alone) - len(kept)
        self._replayed_alone = kept
        self.excused += forgiven
        return forgiven

    @property
    def compared(self) -> int:
        """Stamps that both sides have."""
        return len(self._compared_ns)

    @property
    def unmatched(self) -> int:
        """Messages that only one side has."""
        return len(self._flown) + len(self._replayed_alone)

    @property
    def first_unmatched(self) -> tuple[int, str] | None:
        """Earliest stamp that only one side has, and which side that is."""
        alone = [(stamp, "the flight") for stamp in self._flown]
        alone += [(stamp, "the replay") for stamp in self._replayed_alone]
        return min(alone, default=None)

    @property
    def identical(self) -> bool:
        """There was something to compare, and every message of both sides is the same to the byte."""
        return self.compared > 0 and not self.different and not self.unmatched

    def as_object(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "compared": self.compared,
            "different": len(self.different),
            "unmatched": self.unmatched,
            "identical": self.identical,
            "first_different_ns": min(self.different, default=None),
            "first_unmatched_ns": self.first_unmatched[0] if self.first_unmatched else None,
            "largest_difference": self.largest_difference if np.isfinite(self.largest_difference) else None,
        }

    def text(self) -> str:
        """One line for people."""
        if not self.compared:
            return f"nothing could be compared with the flight{self._unmatched_text()}"
        if self.identical:
            return f"all {self.compared} estimates are the bytes that flew"
        text = f"{len(self.different)} of {self.compared} estimates differ from the flight"
        if self.different:
            text += f", first at {min(self.different)} ns, values by at most {self.largest_difference:.3g}"
        return text + self._unmatched_text()

    def _unmatched_text(self) -> str:
        first = self.first_unmatched
        return f"; {self.unmatched} stand on one side only, the first at {first[0]} ns in {first[1]}" if first else ""

    def _difference(self, flown: bytes, replayed: bytes) -> float:
        try:
            a, b = self._codec.decode(flown), self._codec.decode(replayed)
        except DecodeError:
            return np.inf
        if a.frame_id != b.frame_id:
            return np.inf
        largest = 0.0
        for field in self._codec.fields:
            x, y = (np.asarray(getattr(side, field.name), dtype=np.float64) for side in (a, b))
            if x.shape != y.shape:
                return np.inf
            if x.size:
                largest = max(largest, float(np.max(np.abs(x - y))))
        return largest if np.isfinite(largest) else np.inf
