# SPDX-License-Identifier: Apache-2.0
"""Messages of any shape to CDR bytes, for outputs that are no header followed by numbers (`css_common.codec`).

Markers and transforms are trees of messages with texts and lists in them. Components make them of the plain classes of
`rosbags`, which serialises them without ROS and with zeros for padding: equal messages are equal bytes. Nobody in the
graph listens to such a topic, so nothing here decodes.
"""

import math
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from css_common.codec import Codec, Sample, codec_of, type_name


@cache
def plain_types() -> Typestore:
    """The classes of ROS 2 Jazzy's own messages as `rosbags` has them, and what serialises them."""
    return get_typestore(Stores.ROS2_JAZZY)


def named_only(type_name: str) -> type:
    """A class that stands for a message type which is not installed: enough to serialise, too little to publish."""
    package, _, name = type_name.split("/")
    return type(name, (), {"__module__": f"{package}.msg", "get_fields_and_field_types": staticmethod(dict)})


class TreeCodec:
    """Encoder of one message type; a sample holds the message as its `message`."""

    def __init__(self, message_type: type) -> None:
        """Looks the type up.

        Raises:
            TypeError: it is none of ROS 2's own messages.
        """
        self.message_type = message_type
        self.type_name = type_name(message_type)
        self.fields: tuple = ()
        if self.type_name not in plain_types().types:
            raise TypeError(f"{self.type_name}: neither a header followed by numbers nor a message of ROS 2")

    def encode(self, sample: Sample) -> bytes:
        """Serialised bytes of a sample, filled up to four as DDS does it."""
        data = bytes(plain_types().serialize_cdr(sample.message, self.type_name))
        return data + bytes(-len(data) % 4)

    def sample(self, stamp_ns: int, frame_id: str) -> Sample:
        """A sample whose lists are empty, which is all that such a message is made of."""
        kind: Any = plain_types().types[self.type_name]
        names = (field.name for field in fields(kind) if field.name != "__msgtype__")
        return Sample(stamp_ns, frame_id, message=kind(**{name: [] for name in names}))

    def real_fields(self, names: tuple[str, ...] = ()) -> list:
        """None by name: `first_not_finite` looks at all numbers."""
        return []

    def array_fields(self) -> tuple[str, ...]:
        """None: nobody expects a length."""
        return ()

    @staticmethod
    def first_not_finite(fields: list, sample: Sample) -> str | None:
        """Path of the first number that is NaN or infinite."""
        return next(_not_finite(sample.message, ""), None)


@cache
def encoder_of(message_type: type) -> Codec | TreeCodec:
    """What serialises messages of a class.

    Raises:
        TypeError: nothing here can.
    """
    try:
        return codec_of(message_type)
    except TypeError:
        return TreeCodec(message_type)


def _not_finite(value: Any, path: str) -> Iterator[str]:
    if is_dataclass(value):
        for field in fields(value):
            if field.name != "__msgtype__":
                yield from _not_finite(getattr(value, field.name), f"{path}.{field.name}".lstrip("."))
    elif isinstance(value, list):
        for number, element in enumerate(value):
            yield from _not_finite(element, f"{path}[{number}]")
    elif isinstance(value, np.ndarray):
        if value.dtype.kind == "f" and not np.isfinite(value).all():
            yield path
    elif isinstance(value, float) and not math.isfinite(value):
        yield path
