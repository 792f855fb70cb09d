# SPDX-License-Identifier: Apache-2.0
"""The reference recording with something changed in its messages."""

from collections.abc import Callable, Iterable
from pathlib import Path

from css_common.codec import Codec, Sample, codec_of
from css_recording.bag_metadata import Topic
from css_recording.bag_reader import BagReader
from css_recording.bag_writer import BagWriter

REFERENCE = Path(__file__).parents[1] / "bags" / "reference"
Change = Callable[[str, int, bytes], Iterable[tuple[int, bytes]]]


def rewritten(folder: Path, change: Change, types: dict[str, str] | None = None, **description: str) -> Path:
    """The reference recording with each message replaced by those that `change` gives for it."""
    with BagReader(REFERENCE) as reader, BagWriter(folder, metadata=reader.description | description) as writer:
        for entry in reader.topics:
            writer.add_topic(Topic(entry.topic.name, (types or {}).get(entry.topic.name, entry.topic.type)))
        for message in reader.messages():
            for stamp_ns, data in change(message.topic, message.stamp_ns, message.data):
                writer.write(message.topic, stamp_ns, data)
    return folder


def on(topic: str, act: Callable[[int, bytes], bytes | None]) -> Change:
    """A change of one topic: `act` gives the new bytes of a message, None drops it."""

    def change(of: str, stamp_ns: int, data: bytes) -> Iterable[tuple[int, bytes]]:
        changed = act(stamp_ns, data) if of == topic else data
        return [] if changed is None else [(stamp_ns, changed)]

    return change


def edited(message_type: type, edit: Callable[[Sample], object]) -> Callable[[int, bytes], bytes]:
    codec: Codec = codec_of(message_type)

    def act(stamp_ns: int, data: bytes) -> bytes:
        sample = codec.decode(data)
        edit(sample)
        return codec.encode(sample)

    return act
