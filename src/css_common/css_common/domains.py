# SPDX-License-Identifier: Apache-2.0
"""A ROS domain for one process and its nodes alone: flights and tests that share one answer each other's stamps.

A domain is held by a listening socket with an abstract name. One process in the reach of the machine's network can
have it, whoever its user is; nothing lies on a disk; and the kernel gives it free when the process ends, however it
ends. Who holds it is asked from the socket (its process) and from a file in that process's memory (what it does).

Standard library only: the start of `./sunpoint` and the tests read it before anything is installed or built.
"""

import contextlib
import errno
import json
import os
import socket
import struct
import textwrap
from collections.abc import Iterator, Mapping, MutableMapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from css_common.network import LARGEST_DOMAIN, domain_number, domain_of

FLIGHT = "flight"
TEST = "test"
# Above 101 the ports of a domain reach into those that Linux hands to outgoing connections.
FREE_TO_CHOOSE = range(1, 102)
JOINED = "SUNPOINT_JOINED_DOMAIN"
_HOLDER = "SUNPOINT_DOMAIN_HOLDER"
_NOTE = "sunpoint-domain"
_WAITING = 4096  # askers of a socket that answers nobody


class DomainError(Exception):
    """No domain can be had; one line that says why, and what would help."""


class Holder(NamedTuple):
    """Who has a domain.

    Attributes:
        domain: its number.
        pid: process that holds it.
        kind: `FLIGHT` or `TEST`; empty when the process belongs to somebody else and does not tell.
        name: mission of a flight; of somebody else the command.
        started: UTC, ISO 8601.
        recording: folder of the recording; empty without.
    """

    domain: int
    pid: int
    kind: str
    name: str
    started: str = ""
    recording: str = ""

    def __str__(self) -> str:
        since = f", since {self.started}" if self.started else ""
        recording = f", recording {self.recording}" if self.recording else ""
        return f"{self.kind or 'process'} {self.name} (pid {self.pid}{since}{recording})"


class Held:
    """A domain that is this process's own until `release`, or its end."""

    def __init__(self, domain: int, *resources: Any) -> None:
        self.domain = domain
        self._resources = resources

    def release(self) -> None:
        """Gives the domain free; again does nothing."""
        for resource in self._resources:
            resource.close()
        self._resources = ()

    def __enter__(self) -> "Held":
        return self

    def __exit__(self, *_: object) -> None:
        self.release()


def own(environ: Mapping[str, str], name: str, *, recording: str = "", asked: str | None = None) -> Held:
    """A domain for a flight: the one that is asked for, that of ROS_DOMAIN_ID, or a free one.

    Inside a test it is the test's. A shell that has joined a flight names that flight's domain, which does not count.

    Args:
        environ: environment of the process.
        name: mission.
        recording: folder of the recording.
        asked: the number after `--domain`, if any.

    Raises:
        NetworkError: ROS_DOMAIN_ID or `asked` is no number of a domain.
        DomainError: another process holds it, or there is no free one.
    """
    wanted = _wanted(environ, asked)
    if wanted is None:
        return hold_free(FLIGHT, name, recording)
    held = _hold(wanted, FLIGHT, name, recording)
    if held is not None:
        return held
    holder = holder_of(wanted)
    if holder is not None and holder.kind == TEST and str(holder.pid) == environ.get(_HOLDER):
        return Held(wanted)
    raise DomainError(
        f"ROS domain {wanted} is held by {holder or 'another process'}; "
        "end that, or leave ROS_DOMAIN_ID and --domain away for a free domain"
    )


def _wanted(environ: Mapping[str, str], asked: str | None) -> int | None:
    if asked is not None:
        return domain_number(asked, "--domain")
    domain = domain_of(environ)
    return None if str(domain) == environ.get(JOINED) else domain


def hold_free(kind: str, name: str, recording: str = "") -> Held:
    """A domain that nobody holds and no ROS process of this machine speaks in.

    Raises:
        DomainError: there is none.
    """
    first = os.getpid() % len(FREE_TO_CHOOSE)  # spread out: so that those who choose at once seldom meet
    ports = _bound_ports()
    for domain in (*FREE_TO_CHOOSE[first:], *FREE_TO_CHOOSE[:first]):
        if ports.isdisjoint(_discovery_ports(domain)):
            held = _hold(domain, kind, name, recording)
            if held is not None:
                return held
    raise DomainError(
        f"all ROS domains from {FREE_TO_CHOOSE[0]} to {FREE_TO_CHOOSE[-1]} are in use on this machine; "
        "end a flight, or choose one with --domain"
    )


def hold_for_tests(environ: MutableMapping[str, str]) -> Held:
    """A free domain for a process of tests and what it starts, written into its environment.

    Raises:
        DomainError: there is none.
    """
    held = hold_free(TEST, f"tests of {Path.cwd()}")
    environ.pop(JOINED, None)
    environ["ROS_DOMAIN_ID"], environ[_HOLDER] = str(held.domain), str(os.getpid())
    return held


def flights() -> list[Holder]:
    """The flights that are under way on this machine, by domain. Those of other users may not tell what they are."""
    holders = (holder_of(domain) for domain in range(LARGEST_DOMAIN + 1))
    return [holder for holder in holders if holder is not None and holder.kind != TEST]


def holder_of(domain: int) -> Holder | None:
    """Who holds a domain; None when nobody does."""
    with socket.socket(socket.AF_UNIX) as asker:
        asker.setblocking(False)
        try:
            asker.connect(_address(domain))
        except BlockingIOError:
            return Holder(domain, 0, "", "that does not answer")
        except OSError:
            return None
        pid, _, _ = struct.unpack("3i", asker.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))
    with contextlib.suppress(OSError, ValueError, TypeError):
        for note in _notes(pid):
            holder = Holder(**json.loads(note))
            if holder.domain == domain:
                return holder
    return Holder(domain, pid, "", _command(pid))


def _hold(domain: int, kind: str, name: str, recording: str) -> Held | None:
    started = datetime.now(UTC).isoformat(timespec="seconds")
    holder = Holder(domain, os.getpid(), kind, name, started, recording)
    # before the name: whoever finds the domain taken finds the note too
    note = os.fdopen(os.memfd_create(f"{_NOTE}-{domain}"), "w", encoding="utf-8")
    lock = socket.socket(socket.AF_UNIX)
    held = Held(domain, lock, note)
    try:
        json.dump(holder._asdict(), note)
        note.flush()
        lock.bind(_address(domain))
        lock.listen(_WAITING)
    except OSError as error:
        held.release()
        if error.errno != errno.EADDRINUSE:
            raise DomainError(f"no ROS domain can be held here: {error.strerror}") from error
        return None
    return held


def _address(domain: int) -> str:
    return f"\0sunpoint-domain-{domain}"


def _notes(pid: int) -> Iterator[str]:
    for entry in Path(f"/proc/{pid}/fd").iterdir():
        with contextlib.suppress(FileNotFoundError):
            if f"/memfd:{_NOTE}-" in os.readlink(entry):
                yield entry.read_text(encoding="utf-8")


def _command(pid: int) -> str:
    try:
        words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
    except OSError:
        return "of another user"
    return textwrap.shorten(b" ".join(words).decode(errors="replace"), 100) or "without a name"


def _discovery_ports(domain: int) -> set[int]:
    """UDP ports of which a participant in a domain binds at least one (DDS-RTPS 9.6.1.1)."""
    first = 7400 + 250 * domain
    return {first, *range(first + 10, first + 50)}


def _bound_ports() -> set[int]:
    ports = set()
    for table in ("udp", "udp6"):
        with contextlib.suppress(OSError):
            for line in Path("/proc/net", table).read_text().splitlines()[1:]:
                ports.add(int(line.split()[1].rpartition(":")[2], 16))
    return ports
