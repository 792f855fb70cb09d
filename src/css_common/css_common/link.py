# SPDX-License-Identifier: Apache-2.0
"""What becomes of a node's messages on their way, by the faults that its mission or its operator gives it.

In lockstep nobody may wait for a message that does not come. After what comes instead of it the sender says so by a
gap: a message of the topic's own type with the frame `GAP` and zeros, which listeners take for the silence of that
stamp. A flight with lost messages is therefore the same on every run, and recordings hold what was missing.
"""

import struct
import zlib
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from css_common.case_faults import CaseFault, CaseFaults, Seed, Teller
from css_common.codec import Sample
from css_common.component import TOLD, Component
from css_common.fault_lines import Units
from css_common.link_kinds import (
    CLOCK,
    CORRUPTED,
    DOUBLED,
    DROPPED,
    KINDS,
    LATE,
    LINK_FAULTS,
    MESSAGE,
    ONCE,
    REORDERED,
    SORTS,
    of_sorts,
)
from css_common.mission_section import CASE, PERIOD, SEED
from css_common.random_streams import Stream, random_key, uniform4

if TYPE_CHECKING:
    from css_common.stepping import Port

GAP = "gap"
"""frame_id of a message that says that there is none for its stamp; as long as the usual ones."""

Messages = Iterable[tuple["Port", Sample]]


def gap(port: "Port", stamp_ns: int) -> Sample:
    """What stands on a topic for the message of a stamp that does not come."""
    return port.codec.sample(stamp_ns, GAP)


def is_gap(data: bytes) -> bool:
    """Whether a serialised message is one."""
    return data[12:19] == b"\x04\x00\x00\x00gap"


class _Held(NamedTuple):
    """A message that is still on its way."""

    port: "Port"
    sample: Sample
    due: int  # cycle at which it comes
    after: bool  # behind the message of that cycle


class Link:
    """The way of one node's messages.

    Attributes:
        faults: of the case.
        held: messages that are still on their way.
        tells: somebody may hear of its faults.
        of_process: those of the process, each with its line; they are the host's affair, and only told here.
    """

    def __init__(self, component: Component, units: Units) -> None:
        """Begins with the faults that the component's values have.

        Args:
            component: the sender.
            units: what may fail of its node.
        """
        self._component = component
        self._units = units
        values = component.values
        self._key = random_key(values[SEED], values[CASE])
        self._of_all, self._of_process = (
            CaseFaults(KINDS, units, SORTS, self._key, values[PERIOD], _at_once) for _ in range(2)
        )
        self._done: frozenset[str] = frozenset()
        self.tells = TOLD in component.frames
        self._teller = Teller()
        self.held: list[_Held] = []
        self.take()

    def forget(self, done: Iterable[str]) -> None:
        """Leaves out lines that acted before the node was started again."""
        self._done = frozenset(done)
        self.take()

    def take(self) -> None:
        """Has the faults of the component's values from now on."""
        lines = [line for line in self._component.values[LINK_FAULTS] if line not in self._done]
        self.faults = self._of_all.of(lines)
        of_process = of_sorts(lines, "process")
        apart = list(dict.fromkeys(of_process))
        told = dict(zip(apart, self._of_process.of(apart), strict=True))  # a node is one process
        self.of_process = [(line, told[line]) for line in of_process]

    @property
    def is_quiet(self) -> bool:
        """Messages pass as they are."""
        return len(self.faults) == len(self.of_process) and not self.held

    def memory(self) -> Any:
        """All that the coming messages hang on, for `recall`; messages are never changed."""
        return list(self.faults), list(self.of_process), list(self.held), self._teller.memory()

    def recall(self, memory: Any) -> None:
        """Goes back to a memory, which may be used again."""
        faults, of_process, held, told = memory
        self.faults, self.of_process, self.held = list(faults), list(of_process), list(held)
        self._teller.recall(told)

    def told(self, stamp_ns: int) -> dict[str, Sample]:
        """A message of the faults that act, when that changes."""
        return self._teller.told(self._component, TOLD, stamp_ns, self.faults)

    def carry(self, stamp_ns: int, messages: Messages) -> Iterator[tuple["Port", Sample]]:
        """What comes of the messages of a stamp, in the order in which it comes, and gaps for what does not."""
        if self.is_quiet:
            yield from messages
            return
        step = self._component.step_of(stamp_ns)
        arriving = [held for held in self.held if held.due <= step]
        self.held = [held for held in self.held if held.due > step]
        yield from ((held.port, held.sample) for held in arriving if not held.after)
        topics = self._units.get("message", ())
        for port, sample in messages:
            if port.topic in topics:
                yield from self._one(port, sample, step)
            else:
                yield port, sample
        yield from ((held.port, held.sample) for held in arriving if held.after)

    def _one(self, port: "Port", sample: Sample, step: int) -> Iterator[tuple["Port", Sample]]:
        # a clock that is right again has to be believed first
        sent, whole = [sample], not any(f.sort == CLOCK and step >= f.first_step for f in self.faults)
        for place, fault in enumerate(self.faults):
            if not fault.acts(step) or not self._befalls(fault, port) or sample.frame_id == GAP:
                continue
            u = uniform4(self._key, Stream.LINK_FAULT, step, _index(self._component.name, port.topic, place))
            chosen = fault.kind == LATE or u[0] < fault.values[0]
            if fault.sort == CLOCK:
                offset_ns = round(fault.values[0] * 1e9)
                sent, whole = [_changed(s, stamp_ns=s.stamp_ns + offset_ns) for s in sent], False
            elif not chosen:
                continue
            elif fault.kind == DOUBLED:
                sent = [copy for s in sent for copy in (s, s)]
            elif fault.kind == CORRUPTED:
                sent, whole = [_with_flipped_bit(port, s, u[1], u[2]) for s in sent], False
            else:
                if fault.kind != DROPPED:
                    due = step + (1 if fault.kind == REORDERED else round(fault.values[0]))
                    self.held += (_Held(port, s, due, fault.kind == REORDERED) for s in sent)
                sent, whole = [], False
        yield from ((port, s) for s in sent)
        if not whole:
            yield port, gap(port, sample.stamp_ns)

    def _befalls(self, fault: CaseFault, port: "Port") -> bool:
        if fault.sort == MESSAGE:
            return self._units["message"][fault.unit] == port.topic
        return fault.sort == CLOCK


def _at_once(fault: CaseFault, seed: Seed) -> CaseFault:
    """A fault that happens in one cycle has only that one."""
    once = fault.kind in ONCE and fault.first_step < fault.end_step
    return fault._replace(end_step=fault.first_step + 1) if once else fault


def _index(name: str, topic: str, place: int) -> int:
    """Index of the draws of a fault: no two messages of a flight share any."""
    return zlib.crc32(f"{name} {topic} {place}".encode())


def _changed(sample: Sample, **fields: Any) -> Sample:
    return Sample(**{**vars(sample), **fields})


def _with_flipped_bit(port: "Port", sample: Sample, which: float, bit: float) -> Sample:
    """A message in which one bit of one of its real numbers is another, each equally likely."""
    sizes = {f.name: np.size(getattr(sample, f.name)) for f in port.real_fields}
    at = int(which * sum(sizes.values()))
    for name, size in sizes.items():
        if at < size:
            value = getattr(sample, name)
            numbers = np.array(value, np.float64).ravel()
            numbers[at] = _flipped(float(numbers[at]), int(bit * 64))
            return _changed(sample, **{name: float(numbers[0]) if np.ndim(value) == 0 else numbers})
        at -= size
    return sample


def _flipped(x: float, bit: int) -> float:
    (word,) = struct.unpack("<Q", struct.pack("<d", x))
    flipped: float = struct.unpack("<d", struct.pack("<Q", word ^ 1 << bit))[0]
    return flipped
