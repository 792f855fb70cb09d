# SPDX-License-Identifier: Apache-2.0
"""All messages of one topic as columns: one array per field, one row per message.

A recorded orbit holds 55 500 messages a topic. Messages of Sunpoint's own types are flat, so those of a topic
mostly have the same length, and then one structured view of their joined bytes decodes all of them at once.
Where lengths differ (array lengths or frame names that change), each message goes through its codec.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from css_common.codec import Codec, Sample

_ENCAPSULATION = 4  # bytes before the message; offsets inside the message count from its end
_FRAME_AT = 12  # sec, nanosec, length of frame_id


class Columns:
    """Fields of M messages as arrays of M rows.

    `stamp_ns` (M,) int64 holds the header stamps. A scalar field is (M,), an array field (M, n); rows shorter
    than the longest are filled with NaN. Fields are attributes, named as in the message.
    """

    stamp_ns: np.ndarray

    def __init__(self, stamp_ns: np.ndarray, **fields: np.ndarray) -> None:
        self.stamp_ns = stamp_ns
        self.__dict__.update(fields)

    def __getattr__(self, name: str) -> Any:
        # only reached for a missing field; declared so that type checkers know that fields are attributes
        raise AttributeError(f"the messages have no field {name!r}")

    def __len__(self) -> int:
        return len(self.stamp_ns)

    def __repr__(self) -> str:
        return f"Columns({len(self)} messages: {', '.join(vars(self))})"

    def sorted(self) -> "Columns":
        """The same messages in the order of their stamps, the last of each stamp only.

        A node that was restarted in flight may have answered one stamp twice; the later answer counts.
        """
        stamps = self.stamp_ns
        if np.all(np.diff(stamps) > 0):
            return self
        order = np.argsort(stamps, kind="stable")
        last = np.append(np.diff(stamps[order]) > 0, True)
        chosen = order[last]
        return Columns(**{name: column[chosen] for name, column in vars(self).items()})


def stack(codec: Codec, messages: Sequence[bytes]) -> Columns:
    """Columns of the serialised messages of one type, in the order given.

    Raises:
        DecodeError: a message is damaged or of another type.
    """
    columns = _view(codec, messages) if messages else None
    return columns if columns is not None else columns_of(codec, [codec.decode(data) for data in messages])


def columns_of(codec: Codec, samples: Sequence[Sample]) -> Columns:
    """Columns of decoded messages of one type."""
    stamp_ns = np.array([sample.stamp_ns for sample in samples], dtype=np.int64)
    fields = {}
    for field in codec.fields:
        values = [getattr(sample, field.name) for sample in samples]
        if field.count is None:
            fields[field.name] = np.array(values, dtype=field.dtype)
        elif field.count or len({len(value) for value in values}) <= 1:
            width = field.count or (len(values[0]) if values else 0)
            fields[field.name] = np.array(values, dtype=field.dtype).reshape(len(samples), width)
        else:
            rows = np.full((len(samples), max(map(len, values))), np.nan)
            for row, value in zip(rows, values, strict=True):
                row[: len(value)] = value
            fields[field.name] = rows
    return Columns(stamp_ns, **fields)


def _view(codec: Codec, messages: Sequence[bytes]) -> Columns | None:
    """Columns through one structured view; None when the messages do not all have one layout."""
    size = len(messages[0])
    if size < _ENCAPSULATION + _FRAME_AT or any(len(data) != size for data in messages):
        return None
    codec.decode(messages[0])  # the layout below is checked against a message that is known to be whole
    raw = np.frombuffer(b"".join(messages), dtype=np.uint8).reshape(len(messages), size)
    if np.any(raw[:, :_ENCAPSULATION] != raw[0, :_ENCAPSULATION]):
        return None

    def common_word(at: int) -> int | None:
        """The 32-bit word at an offset if all messages have the same there."""
        words = raw[:, _ENCAPSULATION + at : _ENCAPSULATION + at + 4]
        return int(words[0].view("<u4")[0]) if np.all(words == words[0]) else None

    frame_length = common_word(_FRAME_AT - 4)
    if frame_length is None:
        return None
    at = _FRAME_AT + frame_length
    layout: dict[str, tuple[np.dtype, int]] = {
        "sec": (np.dtype("<i4"), _ENCAPSULATION),
        "nanosec": (np.dtype("<u4"), _ENCAPSULATION + 4),
    }
    for field in codec.fields:
        count = field.count
        if count == 0:
            at += -at % 4
            count = common_word(at)
            if count is None:
                return None
            at += 4
        if count != 0:
            at += -at % field.size
        dtype = field.dtype if count is None else np.dtype((field.dtype, (count,)))
        layout[field.name] = (dtype, _ENCAPSULATION + at)
        at += dtype.itemsize
    names = list(layout)
    formats, offsets = zip(*layout.values(), strict=True)
    message = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": size})
    view = raw.view(message)[:, 0]
    if np.any(view["nanosec"] >= 1_000_000_000):
        return None
    stamp_ns = view["sec"].astype(np.int64) * 1_000_000_000 + view["nanosec"]
    return Columns(stamp_ns, **{name: np.ascontiguousarray(view[name]) for name in names[2:]})
