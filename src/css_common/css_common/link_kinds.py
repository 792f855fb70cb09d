# SPDX-License-Identifier: Apache-2.0
"""What may befall any node of the graph from outside: its messages on their way, its clock, its process.

They are entries of the same section of a mission as the faults of units, with targets `message.TOPIC`, `clock.NODE`
and `process.NODE`. What is told of the truth is no message that a spacecraft has, and cannot fail.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from css_common.fault_lines import FORM, FaultKind, FaultValue, Units
from css_common.schema import Parameter, real, texts

if TYPE_CHECKING:
    from css_common.component import Output

MESSAGE, CLOCK, PROCESS = 6, 7, 8
"""Codes of the sorts, after those of simulated units; never given to another either."""

LATE, DROPPED, DOUBLED, REORDERED, CORRUPTED, STEP, KILLED, HUNG, SLOWED = range(20, 29)
"""Codes of the kinds, in one row with those of units."""

SORTS = {"message": MESSAGE, "clock": CLOCK, "process": PROCESS}

LINK_FAULTS = replace(
    texts("io.faults", (), f"faults of its own messages, clock and process, each {FORM}"),
    tunable=True,
)

_SHARE = FaultValue(real("share", 1.0, "-", "", low=0.0, high=1.0))
_SECONDS = FaultValue(real("seconds", 0.0, "s", "", low=0.0, open_low=True, high=3600.0))

KINDS: tuple[FaultKind, ...] = (
    FaultKind(
        "message",
        "late",
        LATE,
        (FaultValue(real("cycles", 1.0, "-", "", low=1.0, high=1000.0)),),
        "comes so many control cycles late",
    ),
    FaultKind("message", "dropped", DROPPED, (_SHARE,), "this share of them never comes"),
    FaultKind("message", "doubled", DOUBLED, (_SHARE,), "this share of them comes twice"),
    FaultKind("message", "reordered", REORDERED, (_SHARE,), "this share of them comes after the next one"),
    FaultKind("message", "corrupted", CORRUPTED, (_SHARE,), "in this share of them one bit of one number is flipped"),
    FaultKind(
        "clock",
        "step",
        STEP,
        (FaultValue(real("offset", 0.0, "s", "", low=-1e6, high=1e6)),),
        "stamps all that it sends with a time that is off by this",
    ),
    FaultKind("process", "killed", KILLED, (), "is killed once, and started anew by its supervisor"),
    FaultKind("process", "frozen", HUNG, (_SECONDS,), "hangs once, for so much of the wall clock"),
    FaultKind("process", "slow", SLOWED, (_SECONDS,), "takes so much of the wall clock longer for each cycle"),
)

MESSAGES_FAIL = "flies on the graph alone, where messages, clocks and processes are; expected ./sunpoint fly"
PROCESSES_FAIL = "needs a process for each node; expected ./sunpoint fly --processes"

ONCE = (KILLED, HUNG)
"""Kinds that happen in one cycle, the first at which they act."""


def has_messages(outputs: Iterable["Output"]) -> list[str]:
    """Topics of the messages of a node that may fail, in the order of their numbers."""
    return [o.topic for o in outputs if not o.events and o.topic.partition("/")[0] != "truth"]


def units(name: str, outputs: Iterable["Output"], owns_time: bool) -> Units:
    """What may fail of a node.

    Args:
        name: of the node.
        outputs: its topics.
        owns_time: its clock is that of the flight.
    """
    found: dict[str, Sequence[str]] = {}
    topics = has_messages(outputs)
    if topics:
        found["message"] = topics
    if topics and not owns_time:
        found["clock"] = (name,)
    found["process"] = (name,)
    return found


def of_sorts(lines: Iterable[str], *sorts: str) -> list[str]:
    """The lines of some sorts."""
    return [line for line in lines if line.partition(".")[0].split()[:1] in [[sort] for sort in sorts]]


def parameter_of(sort: str, own: Parameter[Any]) -> Parameter[Any]:
    """The parameter that has the lines of a sort: this one, or `own` of the node."""
    return LINK_FAULTS if sort in SORTS else own
