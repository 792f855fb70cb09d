# SPDX-License-Identifier: Apache-2.0
"""Who may speak on a topic: one writer, until it is gone. No ROS here.

The middleware names every writer by a GID. In Fast DDS its first twelve bytes name the participant: vendor (two), host
(two), the low half of the process number (two) and six more, so that a writer whose process has died is known before
its participant's lease ends, which takes twenty seconds.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from css_common.mission import Mission

_FAST_DDS = b"\x01\x0f"
_PROCESS = slice(4, 6)
_GID_LENGTH = 16


class Writer(NamedTuple):
    """A writer of a topic.

    Attributes:
        gid: the middleware's name of it, 16 bytes.
        node: fully qualified name of its node; empty while the middleware does not know it.
    """

    gid: bytes
    node: str


def local_processes() -> frozenset[int]:
    """Low 16 bits of the numbers of the processes that run on this machine.

    One that has ended and is not yet reaped does not run.
    """
    return frozenset(int(name) & 0xFFFF for name in os.listdir("/proc") if name.isdigit() and _runs(name))


def _runs(process: str) -> bool:
    try:
        text = Path("/proc", process, "stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False
    return text.rpartition(")")[2].split()[:1] not in (["Z"], ["X"])


def writer_choice(
    mission: Mission, topic: str, namespace: str, *, only: bool | None = None, node: str = ""
) -> WriterChoice:
    """Who may speak on a topic of a mission.

    Args:
        mission: names the node that publishes each topic of its graph.
        topic: relative name, as in the mission.
        namespace: of the listening node, and so of the graph.
        only: whether the node of the graph alone may speak; None: as the mission says (`io.writers`).
        node: name of the node that publishes a topic which is not the graph's.
    """
    name = mission.publishers.get(topic, node)
    full_name = f"{namespace.rstrip('/')}/{name}" if name else ""
    if only is None:
        only = mission.values.io.writers == "graph"
    return WriterChoice(full_name, only=only and bool(full_name))


class WriterChoice:
    """Chooses the writer of a topic that is heard.

    The first one is, and stays it until it is gone: no longer known to the middleware, or its process no longer runs.

    Attributes:
        accepted: the writer that is heard, or None.
        strangers: other writers that may be speaking now.
    """

    def __init__(self, preferred: str = "", *, only: bool = False) -> None:
        """Begins without any writer.

        Args:
            preferred: fully qualified name of the node whose writer is heard when several appear together.
            only: no other node is ever heard.
        """
        self.accepted: Writer | None = None
        self.strangers: tuple[Writer, ...] = ()
        self._preferred = preferred
        self._only = only
        self._before: Writer | None = None
        self._seen_running: set[bytes] = set()

    def update(self, present: Iterable[Writer], processes: Callable[[], frozenset[int]] = local_processes) -> bool:
        """Takes the writers that the middleware knows now; True when another writer took over from one before.

        Args:
            present: all writers of the topic.
            processes: gives the low 16 bits of the numbers of running processes; asked when there is anybody new.
        """
        writers = list(present)
        running = self._without_dead(writers, processes)
        took_over = False
        kept = next((w for w in running if self.accepted is not None and w.gid == self.accepted.gid), None)
        if kept is None:
            self.accepted = self._choose(running)
            if self.accepted is not None:
                took_over = self._before is not None and self._before.gid != self.accepted.gid
                self._before = self.accepted
        else:
            self.accepted = self._before = kept
        self.strangers = tuple(w for w in running if self.accepted is None or w.gid != self.accepted.gid)
        return took_over

    def admits(self, node: str) -> bool:
        """Whether a writer of this node may ever be heard."""
        return not self._only or node == self._preferred

    @property
    def undecided(self) -> bool:
        """A writer is there whose node is not known yet, and that might be the one to hear."""
        return self.accepted is None and any(not w.node for w in self.strangers)

    def _choose(self, running: list[Writer]) -> Writer | None:
        named = [w for w in running if self._preferred and w.node == self._preferred]
        if named:
            return named[0]
        if self._only:
            return None
        if len(running) > 1 and not all(w.node for w in running):
            return None  # the preferred one may be among them
        heir = [w for w in running if self._before is not None and w.node == self._before.node]
        return next(iter(heir or running), None)

    def _without_dead(self, writers: list[Writer], processes: Callable[[], frozenset[int]]) -> list[Writer]:
        if len(writers) < 2 and all(writer.gid in self._seen_running for writer in writers):
            return writers  # it stays while the middleware knows it
        own = os.getpid() & 0xFFFF
        # writers of this very process run: a composed flight need not look at all others for each of its topics
        now = frozenset((own,)) if all(_process_of(writer.gid) == own for writer in writers) else processes()
        running = []
        for writer in writers:
            if runs(writer, now):
                self._seen_running.add(writer.gid)
            elif writer.gid in self._seen_running:
                continue  # it ran here and does so no more; one that never did may run in another container
            running.append(writer)
        return running


def runs(writer: Writer, processes: frozenset[int]) -> bool:
    """Whether a writer's process is one of those that run on this machine, as far as its GID tells."""
    process = _process_of(writer.gid)
    return process is None or process in processes


def _process_of(gid: bytes) -> int | None:
    """Low 16 bits of the number of a writer's process; None when the GID does not tell."""
    if len(gid) < _GID_LENGTH or gid[:2] != _FAST_DDS:
        return None
    return int.from_bytes(gid[_PROCESS], "little")
