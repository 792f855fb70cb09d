# SPDX-License-Identifier: Apache-2.0
"""Flat messages to and from CDR bytes, without building a Python message object for each.

Deserialising is the dearest part of a hop in rclpy (17 us for a small message), and its serialiser leaves padding
uninitialised, so that equal messages differ in bytes. Sunpoint's nodes publish and receive serialised bytes and
convert them here: four times cheaper, the same bytes for the same values, the same topics and types on the wire.

A message fits when it is one Header followed by numbers: scalars, fixed and unbounded arrays of numbers, and nested
messages made of doubles alone (Vector3, Quaternion, Pose), which appear as one array. It is decoded into a
`Sample`: stamp in nanoseconds, frame and one attribute a field.
"""

import importlib
import math
import struct
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from css_common.kernel import kernel

ENCAPSULATION = b"\x00\x01\x00\x00"  # XCDR1, little endian
_SHIFT = bytes(4)
_HEADER = struct.Struct("<iII")
_U32 = struct.Struct("<I")
_SCALARS = {
    "double": "d", "float": "f", "boolean": "?", "octet": "B",
    "int8": "b", "uint8": "B", "int16": "h", "uint16": "H",
    "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q",
}  # fmt: skip
MAX_FRAME = 256
MAX_ELEMENTS = 1 << 20
_MOST_LAYOUTS = 64


class DecodeError(ValueError):
    """Bytes that are no message of the expected type."""


class Sample:
    """One message: `stamp_ns`, `frame_id` and the message's fields (scalars, float64 or integer arrays)."""

    stamp_ns: int
    frame_id: str

    def __init__(self, stamp_ns: int, frame_id: str, **fields: Any) -> None:
        self.stamp_ns = stamp_ns
        self.frame_id = frame_id
        self.__dict__.update(fields)

    def __getattr__(self, name: str) -> Any:
        # only reached for a missing field; declared so that type checkers know that fields are attributes
        raise AttributeError(f"the message has no field {name!r}")

    if TYPE_CHECKING:

        def __setattr__(self, name: str, value: Any) -> None: ...

    def __repr__(self) -> str:
        fields = ", ".join(f"{key}={value!r}" for key, value in vars(self).items())
        return f"Sample({fields})"


class _Field:
    """One field of a layout: a scalar (`count` None), a fixed array or an unbounded one (`count` 0)."""

    def __init__(self, name: str, code: str, count: int | None) -> None:
        self.name = name
        self.code = code
        self.count = count
        self.dtype = np.dtype("<" + code)
        self.size = self.dtype.itemsize
        self.struct = struct.Struct("<" + code)
        self.zero = False if code == "?" else 0.0 if code in "df" else 0


def type_name(message_type: type) -> str:
    """Name of a message class as ROS tools print it: `css_msgs/msg/CssVoltages`."""
    return f"{message_type.__module__.split('.')[0]}/msg/{message_type.__name__}"


class Codec:
    """Converter of one message type; get it with `codec_of`."""

    def __init__(self, message_type: Any) -> None:
        self.message_type = message_type
        self.type_name = type_name(message_type)
        names = list(message_type.get_fields_and_field_types())
        if not names or message_type.get_fields_and_field_types()[names[0]] != "std_msgs/Header":
            raise TypeError(f"{self.type_name} does not begin with a std_msgs/Header")
        slots = message_type.SLOT_TYPES[1:]
        self.fields = [self._field(name, slot) for name, slot in zip(names[1:], slots, strict=True)]
        self._real_fields = [field for field in self.fields if field.code in "df"]
        self._layouts: dict[tuple[int, ...], struct.Struct] = {}

    def _field(self, name: str, slot: Any) -> _Field:
        kind = type(slot).__name__
        if kind == "BasicType":
            return _Field(name, _SCALARS[slot.typename], None)
        if kind == "Array" and type(slot.value_type).__name__ == "BasicType":
            return _Field(name, _SCALARS[slot.value_type.typename], slot.size)
        if kind == "UnboundedSequence" and type(slot.value_type).__name__ == "BasicType":
            return _Field(name, _SCALARS[slot.value_type.typename], 0)
        if kind == "NamespacedType":
            return _Field(name, "d", _doubles_in(slot))
        raise TypeError(f"{self.type_name}.{name}: {kind} is not a number or an array of numbers")

    def decode(self, data: bytes) -> Sample:
        """The message in serialised `data`.

        Raises:
            DecodeError: the bytes are too short, too long or not little-endian CDR.
        """
        if data[:4] != ENCAPSULATION:
            raise DecodeError(f"{self.type_name}: encapsulation {data[:4].hex()} is not little-endian CDR")
        # Shifted by four bytes, the doubles behind the encapsulation are aligned in memory: kernels take the
        # arrays as they are, in the one form for which they were compiled.
        buffer = bytearray(_SHIFT + data)
        try:
            seconds, nanoseconds, length = _HEADER.unpack_from(buffer, 8)
            if not 1 <= length <= MAX_FRAME or nanoseconds >= 1_000_000_000:
                raise DecodeError(f"{self.type_name}: the header is damaged")
            sample = Sample.__new__(Sample)
            values = sample.__dict__
            values["stamp_ns"] = seconds * 1_000_000_000 + nanoseconds
            values["frame_id"] = data[16 : 15 + length].decode()
            at = 12 + length  # offsets count from the end of the encapsulation
            for field in self.fields:
                count = field.count
                if count is None:
                    at += -at % field.size
                    values[field.name] = field.struct.unpack_from(buffer, at + 8)[0]
                    at += field.size
                    continue
                if count == 0:
                    at += -at % 4
                    count = _U32.unpack_from(buffer, at + 8)[0]
                    at += 4
                    if count > MAX_ELEMENTS:
                        raise DecodeError(f"{self.type_name}.{field.name}: {count} elements")
                if count:
                    at += -at % field.size
                values[field.name] = np.frombuffer(buffer, field.dtype, count, at + 8)
                at += count * field.size
        except DecodeError:
            raise
        except (struct.error, ValueError) as error:
            raise DecodeError(f"{self.type_name}: {len(data)} bytes do not hold the message ({error})") from error
        # Some serialisers pad the end to four bytes; rclpy's aligns to doubles behind the count of an empty array.
        if not 0 <= len(data) - 4 - at < 8:
            raise DecodeError(f"{self.type_name}: {len(data)} bytes given, the message takes {at + 4}")
        return sample

    def encode(self, sample: Sample) -> bytes:
        """Serialised bytes of a sample; padding is zero, so equal samples are equal bytes.

        Raises:
            ValueError: an array has not the length that the type fixes.
        """
        frame = sample.frame_id.encode() + b"\0"
        values = sample.__dict__
        given: list[Any] = [ENCAPSULATION, *divmod(sample.stamp_ns, 1_000_000_000), len(frame), frame]
        lengths = []
        for field in self.fields:
            value = values[field.name]
            if field.count is None:
                given.append(value)
                continue
            if type(value) is not np.ndarray or value.dtype is not field.dtype:
                value = np.asarray(value, field.dtype)
            if field.count == 0:
                lengths.append(value.size)
                given.append(value.size)
            elif value.size != field.count:
                raise ValueError(
                    f"{self.type_name}.{field.name}: {value.size} values given, the type has {field.count}"
                )
            given.append(value.tobytes())
        layout = (len(frame), *lengths)
        packed = self._layouts.get(layout)
        if packed is None:
            if len(self._layouts) >= _MOST_LAYOUTS:
                self._layouts.clear()
            packed = self._layouts[layout] = self._packed(*layout)
        return packed.pack(*given)

    def _packed(self, frame_length: int, *lengths: int) -> struct.Struct:
        """The whole message, for given lengths of its frame and unbounded arrays; padding is zero."""
        code, at, unbounded = f"<4siII{frame_length}s", 12 + frame_length, iter(lengths)
        for field in self.fields:
            count = 1 if field.count is None else field.count
            if field.count == 0:
                code += f"{-at % 4}xI"
                at += -at % 4 + 4
                count = next(unbounded)
            pad = -at % field.size if count else 0
            code += f"{pad}x" + (field.code if field.count is None else f"{count * field.size}s")
            at += pad + count * field.size
        # DDS fills a payload up to four bytes, with whatever was in memory, unless that is done here
        return struct.Struct(f"{code}{-at % 4}x")

    def sample(self, stamp_ns: int, frame_id: str, **given: Any) -> Sample:
        """A sample with zeros in the fields that are not given."""
        fields: dict[str, Any] = {
            f.name: f.zero if f.count is None else np.zeros(f.count, f.dtype) for f in self.fields
        }
        for name in given:
            if name not in fields:
                raise TypeError(f"{self.type_name} has no field {name}")
        fields.update(given)
        return Sample(stamp_ns, frame_id, **fields)

    def array_fields(self) -> tuple[str, ...]:
        """Names of the fields of unbounded length."""
        return tuple(f.name for f in self.fields if f.count == 0)

    def real_fields(self, names: tuple[str, ...] = ()) -> list[_Field]:
        """The fields of floating-point numbers, all or those named.

        Raises:
            KeyError: a name that the type does not have.
        """
        if not names:
            return self._real_fields
        by_name = {f.name: f for f in self.fields}
        return [f for f in (by_name[n] for n in names) if f.code in "df"]

    @staticmethod
    def first_not_finite(fields: list[_Field], sample: Sample) -> str | None:
        """Name of the first of some `real_fields` that holds a NaN or an infinity."""
        values = sample.__dict__
        for field in fields:
            value = values[field.name]
            if field.count is None:
                if not math.isfinite(value):
                    return field.name
            elif not _is_finite(value):
                return field.name
        return None


@kernel
def _is_finite(values) -> bool:
    # x - x is 0 for a finite x and NaN otherwise: no branch in the loop
    total = 0.0
    for value in values:
        total += value - value
    return total == 0.0


def _doubles_in(slot: Any) -> int:
    """Number of doubles in a nested message that holds nothing else."""
    module = importlib.import_module(".".join(slot.namespaces))
    count = 0
    for inner in getattr(module, slot.name).SLOT_TYPES:
        if type(inner).__name__ == "NamespacedType":
            count += _doubles_in(inner)
        elif type(inner).__name__ == "BasicType" and inner.typename == "double":
            count += 1
        else:
            raise TypeError(f"{slot.name} holds more than doubles")
    return count


@cache
def codec_of(message_type: type) -> Codec:
    """The codec of a message class.

    Raises:
        TypeError: the type is not a Header followed by numbers.
    """
    return Codec(message_type)


def stamp_of(data: bytes) -> int:
    """Stamp [ns] of any serialised message that begins with a Header, without decoding the rest.

    Raises:
        DecodeError: the bytes are too short or not little-endian CDR.
    """
    if len(data) < 12 or data[:4] != ENCAPSULATION:
        raise DecodeError(f"{len(data)} bytes do not begin with a Header in little-endian CDR")
    seconds, nanoseconds = struct.unpack_from("<iI", data, 4)
    return seconds * 1_000_000_000 + nanoseconds
