# SPDX-License-Identifier: Apache-2.0
"""What the reader of a recording needs of a storage, and the words for one that cannot be read."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple, Protocol

from css_recording.bag_metadata import Topic
from css_recording.errors import BagError

StoredMessage = tuple[int, str, str, bytes]
"""Log time [ns], topic, type, serialised message."""

NO_CHECK_SUM = "it holds no check sum of all its data: damage outside of its chunks cannot be seen"


class TopicCount(NamedTuple):
    """A topic of a recording and how many messages it has."""

    topic: Topic
    count: int  # type: ignore[assignment]  # the method of tuples that it hides is not missed


class BagStorage(Protocol):
    """What the reader needs of a storage; topics by their recorded, absolute names, those of other encodings too."""

    notes: list[str]
    """What a reader of the recording must know, one text each."""

    def topics(self) -> list[TopicCount]:
        """Topics in the order of the recording."""

    def time_span(self) -> tuple[int, int]:
        """Log times [ns] of the earliest and the latest message; zeros when there is none."""

    def metadata(self) -> list[tuple[str, dict[str, str]]]:
        """Named sets of texts in the order of the recording."""

    def messages(self, topics: frozenset[str], start_ns: int, end_ns: int) -> Iterator[StoredMessage]:
        """Messages of these topics with log times in [start_ns, end_ns), in log-time order."""

    def close(self) -> None:
        """Release the files."""


def unfinished(path: Path, reason: str) -> BagError:
    """The error for a recording whose recorder did not close it."""
    return BagError(f"{path}: the recording is unfinished: {reason}; mend it with `{_recover()} {path}`")


def damaged(path: Path, reason: str) -> BagError:
    """The error for a recording in which something other than its end is damaged."""
    return BagError(f"{path}: is damaged: {reason}; `{_recover()} {path} -o NEW` saves what can be read")


def _recover() -> str:
    return "./sunpoint recover" if os.environ.get("SUNPOINT_HOME") else "ros2 run css_recording recover"
