# SPDX-License-Identifier: Apache-2.0
"""What a user asks of a recording beside its topics: what is left out, quality of service, when a file is over."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from rclpy.qos import QoSProfile

from css_recording.bag_metadata import absolute
from css_recording.errors import BagError
from css_recording.split_bag_writer import FileLimits

_NAME = re.compile(r"[A-Za-z0-9_/]+")


class Excluded:
    """Topics that are not to be recorded: a plain name is that topic, all else a regular expression found in names."""

    def __init__(self, texts: Iterable[str] = ()) -> None:
        """Takes names and expressions.

        Args:
            texts: of either kind.

        Raises:
            BagError: an expression is none.
        """
        self._names: set[str] = set()
        self._patterns: list[re.Pattern[str]] = []
        for text in texts:
            if _NAME.fullmatch(text):
                self._names.add(absolute(text))
                continue
            try:
                self._patterns.append(re.compile(text))
            except re.error as error:
                raise BagError(f"--exclude {text}: is neither a topic nor a regular expression: {error}") from error

    def __contains__(self, topic: str) -> bool:
        return topic in self._names or any(pattern.search(topic) for pattern in self._patterns)


@dataclass(frozen=True)
class RecordingChoice:
    """How a recording is made.

    Attributes:
        excluded: topics that are left out although they would be recorded.
        qos: quality of service of topics that are not to have the strictest that matches what is offered.
        limits: of a file of the recording; the next one begins beyond.
    """

    excluded: Excluded = field(default_factory=Excluded)
    qos: Mapping[str, QoSProfile] = field(default_factory=dict)
    limits: FileLimits = field(default_factory=FileLimits)
