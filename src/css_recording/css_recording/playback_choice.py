# SPDX-License-Identifier: Apache-2.0
"""What of a recording is to be played: topics and span, checked before anything is."""

from collections.abc import Callable
from operator import attrgetter
from typing import NamedTuple

from css_recording.bag_metadata import Topic
from css_recording.errors import BagError
from css_recording.merged_bags import Recording
from css_recording.playback import PlaybackOptions


class Choice(NamedTuple):
    """What is played."""

    topics: tuple[Topic, ...]
    pacing: str  # topic whose stamps are answered in lockstep
    start_ns: int  # first log time
    end_ns: int | None  # log time before which the playback ends; None: with the last message


def choose(recording: Recording, options: PlaybackOptions, resolve: Callable[[str], str]) -> Choice:
    """What the options choose of a recording.

    Args:
        recording: one or several.
        options: how it is played.
        resolve: gives the full name of a topic.

    Raises:
        BagError: the recording is empty, or nothing in it is what the options ask for.
    """
    entries = {entry.topic.name: entry for entry in recording.topics if entry.count}
    if not entries:
        raise BagError(f"{recording.name}: holds no messages")

    def known(name: str) -> str:
        full = resolve(name)
        if full not in entries:
            raise BagError(f"{recording.name}: no topic {full}; there are messages of {', '.join(sorted(entries))}")
        return full

    names = list(entries) if options.topics is None else list(dict.fromkeys(map(known, options.topics)))
    busiest = max((entries[name] for name in names), key=attrgetter("count")).topic.name
    pacing = known(options.pace) if options.pace else busiest
    start_ns, end_ns = _span(recording, options)
    if next(iter(recording.messages(set(names), start_ns, end_ns)), None) is None:
        raise BagError(f"{recording.name}: no message of {', '.join(sorted(names))} in the span to be played")
    return Choice(tuple(entries[name].topic for name in names), pacing, start_ns, end_ns)


def _span(recording: Recording, options: PlaybackOptions) -> tuple[int, int | None]:
    start, end = options.start, options.end
    length = (recording.end_ns - recording.start_ns) * 1e-9
    if start > length:
        raise BagError(f"{recording.name}: the start, {start:g} s, is past the end, {length:g} s")
    if end is not None and end <= start:
        raise BagError(f"the end, {end:g} s, is not after the start, {start:g} s")
    start_ns = recording.start_ns + round(start * 1e9)
    return start_ns, None if end is None or end > length else recording.start_ns + round(end * 1e9)
