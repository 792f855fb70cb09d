# SPDX-License-Identifier: Apache-2.0
"""All messages of one topic as columns: one array per field, one row per message.

A recorded orbit holds 55 500 messages a topic. Messages of Sunpoint's own types are flat, so those of a topic
mostly have the same layout, and then one structured view of their joined bytes decodes or encodes all of them at once.
Where layouts differ (array lengths or frame names that change), each message goes through its codec.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from css_common.codec import ENCAPSULATION, Codec, Sample

_ENCAPSULATION = len(ENCAPSULATION)  # bytes before the message; offsets inside the message count from its end
_FRAME_AT = 12  # sec, nanosec, length of frame_id
_SECOND_NS = 1_000_000_000


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
    alike = stack_alike(codec, messages)
    return alike.columns if alike is not None else columns_of(codec, [codec.decode(data) for data in messages])


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


class Alike(NamedTuple):
    """Messages of one layout."""

    frame_id: str
    columns: Columns


def stack_alike(codec: Codec, messages: Sequence[bytes]) -> Alike | None:
    """Frame and columns of serialised messages; None when they do not all have one layout and frame, or are none.

    Raises:
        DecodeError: the first message is damaged or of another type.
    """
    size = len(messages[0]) if messages else 0
    if size < _ENCAPSULATION + _FRAME_AT or any(len(data) != size for data in messages):
        return None
    first = codec.decode(messages[0])  # the layout below is checked against a message that is known to be whole
    raw = np.frombuffer(b"".join(messages), dtype=np.uint8).reshape(len(messages), size)

    def common_word(at: int) -> int | None:
        """The 32-bit word at an offset if all messages have the same there."""
        words = raw[:, _ENCAPSULATION + at : _ENCAPSULATION + at + 4]
        return int(words[0].view("<u4")[0]) if np.all(words == words[0]) else None

    frame_length = common_word(_FRAME_AT - 4)
    if frame_length is None:
        return None
    frame_end = _ENCAPSULATION + _FRAME_AT + frame_length
    alike = np.r_[:_ENCAPSULATION, _ENCAPSULATION + _FRAME_AT : frame_end]
    if np.any(raw[:, alike] != raw[0, alike]):
        return None
    layout = _layout(codec, frame_length, lambda _, at: common_word(at))
    if layout is None:
        return None
    view = raw.view(layout.message(size))[:, 0]
    if np.any(view["nanosec"] >= _SECOND_NS):
        return None
    stamp_ns = view["sec"].astype(np.int64) * _SECOND_NS + view["nanosec"]
    return Alike(
        first.frame_id, Columns(stamp_ns, **{f.name: np.ascontiguousarray(view[f.name]) for f in codec.fields})
    )


def unstack(codec: Codec, frame_id: str, columns: Columns) -> list[bytes]:
    """The serialised messages of one frame: for each row the bytes that the codec gives for it.

    Raises:
        ValueError: an array has not the length that the type fixes, or a number is none of its type.
    """
    frame = frame_id.encode() + b"\0"
    widths = {field.name: np.shape(getattr(columns, field.name))[1:] for field in codec.fields}
    for field in codec.fields:
        expected = () if field.count is None else (field.count or sum(widths[field.name]),)
        if widths[field.name] != expected:
            raise ValueError(f"{codec.type_name}.{field.name}: rows of {widths[field.name]} given, expected {expected}")
    layout = _layout(codec, len(frame), lambda name, _: widths[name][0])
    assert layout is not None
    size = _ENCAPSULATION + layout.size + -layout.size % 4
    raw = np.zeros((len(columns), size), np.uint8)
    raw[:, :_ENCAPSULATION] = np.frombuffer(ENCAPSULATION, np.uint8)
    raw[:, _ENCAPSULATION + _FRAME_AT :][:, : len(frame)] = np.frombuffer(frame, np.uint8)
    view = raw.view(layout.message(size))[:, 0]
    view["sec"], view["nanosec"] = np.divmod(columns.stamp_ns, _SECOND_NS)
    view["frame"] = len(frame)
    for name, (count, _) in layout.counts.items():
        view[_count_of(name)] = count
    for field in codec.fields:
        given = getattr(columns, field.name)
        view[field.name] = given
        if field.code not in "df" and np.any(view[field.name] != given):
            raise ValueError(f"{codec.type_name}.{field.name}: a number given that {field.dtype.name} does not hold")
    joined = raw.tobytes()
    return [joined[at : at + size] for at in range(0, len(joined), size)]


class _Layout(NamedTuple):
    """Where the fields of messages with given frame and array lengths stand, behind the encapsulation."""

    fields: dict[str, tuple[np.dtype, int]]
    counts: dict[str, tuple[int, int]]  # of unbounded arrays: elements, and where their number stands
    size: int

    def message(self, size: int) -> np.dtype:
        """The whole message of some bytes as a structure."""
        places = dict(self.fields)
        places |= {_count_of(name): (np.dtype("<u4"), at) for name, (_, at) in self.counts.items()}
        places |= {"sec": (np.dtype("<i4"), 0), "nanosec": (np.dtype("<u4"), 4), "frame": (np.dtype("<u4"), 8)}
        formats, offsets = zip(*places.values(), strict=True)
        offsets = [_ENCAPSULATION + at for at in offsets]
        return np.dtype({"names": list(places), "formats": formats, "offsets": offsets, "itemsize": size})


def _count_of(name: str) -> str:
    return f"{name}.count"  # no field of a message has such a name


def _layout(codec: Codec, frame_length: int, length_at: Callable[[str, int], int | None]) -> _Layout | None:
    """The layout; None when one of the lengths of unbounded arrays, which are asked for by name and place, is None."""
    fields: dict[str, tuple[np.dtype, int]] = {}
    counts: dict[str, tuple[int, int]] = {}
    at = _FRAME_AT + frame_length
    for field in codec.fields:
        count = field.count
        if count == 0:
            at += -at % 4
            count = length_at(field.name, at)
            if count is None:
                return None
            counts[field.name] = count, at
            at += 4
        if count != 0:
            at += -at % field.size
        dtype = field.dtype if count is None else np.dtype((field.dtype, (count,)))
        fields[field.name] = dtype, at
        at += dtype.itemsize
    return _Layout(fields, counts, at)
