# SPDX-License-Identifier: Apache-2.0
"""What was refused, lost or doubtful in a flight and in reading it, and why; what flew it."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from css_analysis.flight_log import FlightLog
from css_recording.bag_reader import BagReader
from css_recording.provenance import INCIDENTS, NOTHING, REPLAY_INCIDENTS
from css_report.blocks import Block, Listing, Table

_TOLD_ELSEWHERE = (INCIDENTS, REPLAY_INCIDENTS, "mission")


class Provenance(NamedTuple):
    """What a recording says of itself.

    Attributes:
        description: entries beside the messages: versions, what the recorder noted.
        topics: name, type and number of messages.
    """

    description: Mapping[str, str]
    topics: Sequence[tuple[str, str, int]]


def provenance_of(bag: Path) -> Provenance:
    """Of a recording.

    Raises:
        BagError: it cannot be read.
    """
    with BagReader(bag) as reader:
        topics = [(topic.name, topic.type, count) for topic, count in reader.topics]
        return Provenance(reader.description, topics)


def edge_blocks(log: FlightLog, provenance: Provenance, remarks: Sequence[str]) -> Iterator[Block]:
    """What was not as it should be: as recorder and replay wrote it, as reading it showed, as the caller knows.

    Args:
        log: the flight.
        provenance: of its recording.
        remarks: further lines.
    """
    noted, replayed = (provenance.description.get(key) for key in (INCIDENTS, REPLAY_INCIDENTS))
    if noted is None:
        yield "The recording does not say what nodes refused, withheld or missed in flight."
    elif noted.strip() == NOTHING:
        yield "In flight nothing was refused, withheld, lost or missed: no node counted anything of the kind."
    else:
        yield "In flight, as nodes and recorder counted it:"
        yield Listing(noted.splitlines())
    if replayed is not None and replayed.strip() == NOTHING:
        yield "In the replay nothing was refused, withheld or missed: no estimator counted anything of the kind."
    elif replayed is not None:
        yield "In the replay, as its estimators counted it:"
        yield Listing(replayed.splitlines())
    lines = [*log.notes, *remarks]
    if lines:
        yield "In reading the recording, and beside it:"
        yield Listing(list(dict.fromkeys(lines)))
    else:
        yield "In reading the recording nothing was left out."


def version_table(provenance: Provenance) -> Table:
    """What made a recording."""
    told = {key: value for key, value in provenance.description.items() if key not in _TOLD_ELSEWHERE}
    return Table(("what flew it", "version"), [[key, value] for key, value in sorted(told.items())])


def topic_table(provenance: Provenance) -> Table:
    """What is in a recording."""
    return Table(("topic", "type", "messages"), [[name, kind, str(count)] for name, kind, count in provenance.topics])
