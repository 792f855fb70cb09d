# SPDX-License-Identifier: Apache-2.0
"""How values of kernels lie in C structs: NamedTuples, tuples, numbers and arrays, and back.

Numbers are `double`, `float` and integers of a stated width, flags are bytes of 0 or 1. With natural alignment the
same struct has the same bytes under every ABI for which Sunpoint exports; generated code checks its size.
"""

import hashlib
import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numba.core import types

from css_export.errors import ExportError


@dataclass(frozen=True)
class Scalar:
    """A number or a flag.

    Attributes:
        name: its type in C.
        code: that of `struct` and, after "<", of numpy.
        size: [bytes], which is its alignment too.
    """

    name: str
    code: str
    size: int

    @property
    def alignment(self) -> int:
        """In bytes."""
        return self.size


@dataclass(frozen=True)
class Array:
    """Elements of one kind, one after the other."""

    element: "Layout"
    count: int

    @property
    def size(self) -> int:
        """In bytes."""
        return self.element.size * self.count

    @property
    def alignment(self) -> int:
        """In bytes."""
        return self.element.alignment


@dataclass(frozen=True)
class Field:
    """A member of a struct; one that C cannot have (nothing, or no elements) has size 0."""

    name: str
    layout: "Layout"
    offset: int
    comment: str = ""


@dataclass(frozen=True)
class Struct:
    """Named members.

    Attributes:
        name: of the class that it is made from.
        size: with the padding at its end [bytes].
    """

    name: str
    fields: tuple[Field, ...]
    size: int
    alignment: int


Layout = Scalar | Array | Struct

REAL = Scalar("double", "d", 8)
SINGLE = Scalar("float", "f", 4)
FLAG = Scalar("uint8_t", "?", 1)
NOTHING = Struct("nothing", (), 0, 1)
_SCALARS = {"d": REAL, "f": SINGLE, "?": FLAG}
_SCALARS |= {code: Scalar(f"int{8 * size}_t", code, size) for code, size in (("b", 1), ("h", 2), ("i", 4), ("q", 8))}
_SCALARS |= {code: Scalar(f"uint{8 * size}_t", code, size) for code, size in (("B", 1), ("H", 2), ("I", 4), ("Q", 8))}
_INTEGERS = {(True, 1): "b", (True, 2): "h", (True, 4): "i", (True, 8): "q"}
_INTEGERS |= {(False, size): code.upper() for (_, size), code in list(_INTEGERS.items())}


def struct_of(
    name: str, members: list[tuple[str, Layout]], comment_of: Callable[[str], str] = lambda name: ""
) -> Struct:
    """A struct with its members in their order, each naturally aligned."""
    fields, at, alignment = [], 0, 1
    for member, layout in members:
        if layout.size:
            at = -(-at // layout.alignment) * layout.alignment
            alignment = max(alignment, layout.alignment)
        fields.append(Field(member, layout, at, comment_of(member)))
        at += layout.size
    return Struct(name, tuple(fields), -(-at // alignment) * alignment, alignment)


def layout_of(kind: Any, value: Any, where: str, comments: Callable[[Any], Callable[[str], str]]) -> Layout:
    """Layout of values of a type of numba.

    Args:
        kind: the type.
        value: one of them, for the sizes of arrays; None where there are none.
        where: what it is, for errors.
        comments: of the members of a NamedTuple or of a record.

    Raises:
        ExportError: C has no such value.
    """
    if isinstance(kind, types.NoneType):
        return NOTHING
    if isinstance(kind, types.Boolean):
        return FLAG
    if isinstance(kind, types.Float):
        return REAL if kind.bitwidth == 64 else SINGLE
    if isinstance(kind, types.Integer):
        number: Any = kind
        return _SCALARS[_INTEGERS[number.signed, number.bitwidth // 8]]
    if isinstance(kind, types.Array) and value is not None:
        return _layout_of_array(kind, value, where, comments)
    if isinstance(kind, types.BaseNamedTuple):
        named: Any = kind
        source = named.instance_class
        members = [
            (name, layout_of(part, None if value is None else value[i], f"{where}.{name}", comments))
            for i, (name, part) in enumerate(zip(named.fields, named.types, strict=True))
        ]
        return struct_of(source.__name__.lstrip("_"), members, comments(source))
    if isinstance(kind, types.BaseTuple):
        several: Any = kind
        parts = [
            layout_of(part, None if value is None else value[i], f"{where}[{i}]", comments)
            for i, part in enumerate(several.types)
        ]
        if all(part == parts[0] for part in parts):
            return Array(parts[0], len(parts)) if parts else NOTHING
        return struct_of("tuple", [(f"item{i}", part) for i, part in enumerate(parts)])
    raise ExportError(f"{where}: a value of type {kind} has no place in C")


def _layout_of_array(kind: Any, value: np.ndarray, where: str, comments: Callable[[Any], Any]) -> Layout:
    if kind.layout != "C":
        raise ExportError(f"{where}: an array whose elements do not follow one another (layout {kind.layout})")
    layout = _layout_of_dtype(value.dtype, where, comments)
    for count in reversed(value.shape):
        layout = Array(layout, count)
    return layout


def _layout_of_dtype(dtype: np.dtype, where: str, comments: Callable[[Any], Any]) -> Layout:
    if dtype.subdtype is not None:
        base, shape = dtype.subdtype
        layout = _layout_of_dtype(base, where, comments)
        for count in reversed(shape):
            layout = Array(layout, count)
        return layout
    if dtype.names is None:
        if dtype.char not in _SCALARS and dtype.kind not in "iu":
            raise ExportError(f"{where}: elements of type {dtype} have no place in C")
        return _SCALARS[dtype.char if dtype.char in _SCALARS else _INTEGERS[dtype.kind == "i", dtype.itemsize]]
    fields = dtype.fields
    assert fields is not None
    members = [(name, _layout_of_dtype(fields[name][0], f"{where}.{name}", comments)) for name in dtype.names]
    made = struct_of("row", members, comments(dtype))
    told = [fields[name][1] for name in dtype.names]
    if [field.offset for field in made.fields] != told or made.size != dtype.itemsize:
        raise ExportError(f"{where}: a record whose fields are not aligned as in C; expected align=True")
    return made


def pack(layout: Layout, value: Any, into: bytearray | None = None, at: int = 0) -> bytearray:
    """The bytes of a value, little-endian, padding zero."""
    into = bytearray(layout.size) if into is None else into
    if isinstance(layout, Scalar):
        struct.pack_into("<" + layout.code, into, at, value)
    elif isinstance(value, np.ndarray):
        data = np.ascontiguousarray(value).tobytes() if value.dtype.names is None else _record_bytes(value)
        into[at : at + len(data)] = data
    elif isinstance(layout, Array):
        for i in range(layout.count):
            pack(layout.element, value[i], into, at + i * layout.element.size)
    else:
        for field, part in zip(layout.fields, () if value is None else value, strict=False):
            pack(field.layout, part, into, at + field.offset)
    return into


def _record_bytes(value: np.ndarray) -> bytes:
    clean = np.zeros(value.shape, value.dtype)  # what stands in its padding is nobody's
    names = value.dtype.names
    assert names is not None
    for name in names:
        clean[name] = value[name]
    return clean.tobytes()


def unpack(layout: Layout, like: Any, data: bytes | bytearray | memoryview, at: int = 0) -> Any:
    """The value that bytes stand for.

    Args:
        layout: of the value.
        like: a value or a type of numba of the same kind, which says of what class NamedTuples are.
        data: its bytes from `at` on.
    """
    if isinstance(layout, Scalar):
        return struct.unpack_from("<" + layout.code, data, at)[0]
    if isinstance(like, types.NoneType) or like is None:
        return None
    if isinstance(like, np.ndarray):
        return np.frombuffer(data, like.dtype, like.size, at).reshape(like.shape).copy()
    parts: Any = getattr(like, "types", like)
    if isinstance(layout, Array):
        size = layout.element.size
        return tuple(unpack(layout.element, parts[i], data, at + i * size) for i in range(layout.count))
    made = [unpack(f.layout, part, data, at + f.offset) for f, part in zip(layout.fields, parts, strict=True)]
    source: Any = getattr(like, "instance_class", type(like))
    return source(*made) if hasattr(source, "_fields") else tuple(made)


def leaves(layout: Layout, name: str = "", at: int = 0) -> Iterator[tuple[str, Scalar, int]]:
    """Name in C, kind and offset of every number."""
    if isinstance(layout, Scalar):
        yield name, layout, at
    elif isinstance(layout, Array):
        for i in range(layout.count):
            yield from leaves(layout.element, f"{name}[{i}]", at + i * layout.element.size)
    else:
        for field in layout.fields:
            yield from leaves(field.layout, f"{name}.{field.name}" if name else field.name, at + field.offset)


def other_order(layout: Layout, data: bytes | bytearray) -> bytes:
    """Structs one after the other, each number in the other order of bytes."""
    return np.frombuffer(bytes(data), np.uint8).reshape(-1, max(layout.size, 1))[:, _turned(layout)].tobytes()


@lru_cache
def _turned(layout: Layout) -> np.ndarray:
    """Where each byte of a struct in the other order of bytes comes from."""
    place = np.arange(layout.size)
    for _, scalar, at in leaves(layout):
        place[at : at + scalar.size] = place[at : at + scalar.size][::-1]
    return place


def layout_number(structs: Mapping[str, Struct]) -> int:
    """A number of 63 bits for what structs are: names, kinds and offsets of their members; never 0."""
    digest = hashlib.sha256()
    for role, layout in sorted(structs.items()):
        digest.update(f"{role} {layout.size}\n".encode())
        for name, scalar, at in leaves(layout):
            digest.update(f"{name} {scalar.code} {at}\n".encode())
    return int.from_bytes(digest.digest()[:8], "big") >> 1 | 1
