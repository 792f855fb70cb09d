# SPDX-License-Identifier: Apache-2.0
"""Message classes made from `.msg` files, for machines without ROS, which generates and compiles them elsewhere.

Everything here reads and writes messages as bytes by `css_common.codec`, which asks a message class for its fields and
their types alone. A class made here answers as the generated one does, with its constants; it holds no values.
`tools/bootstrap` lays out packages (`css_msgs.msg`, `sensor_msgs.msg`, ...) that take their classes from here, so that
`from css_msgs.msg import SunEstimate` means the same with ROS and without.
"""

from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import FieldDesc
from rosbags.typesys import get_types_from_msg

from css_common.installed import share_folder

# names of ROS interface files and of IDL, which generated classes speak
_IDL = {
    "bool": "boolean", "byte": "octet", "char": "uint8", "float32": "float", "float64": "double",
    **{f"{sign}int{bits}": f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)},
}  # fmt: skip


class BasicType(NamedTuple):
    """A number or a truth value, by its name in IDL."""

    typename: str


class UnboundedString(NamedTuple):
    """A string of any length."""


class BoundedString(NamedTuple):
    """A string of at most so many characters."""

    maximum_size: int


class NamespacedType(NamedTuple):
    """Another message, e.g. ("std_msgs", "msg") and "Header"."""

    namespaces: tuple[str, ...]
    name: str


class Array(NamedTuple):
    """A fixed number of values."""

    value_type: Any
    size: int


class UnboundedSequence(NamedTuple):
    """Any number of values."""

    value_type: Any


class BoundedSequence(NamedTuple):
    """At most so many values."""

    value_type: Any
    maximum_size: int


class MessageClass:
    """What every class made here is: a type with fields and constants."""

    SLOT_TYPES: ClassVar[tuple[Any, ...]] = ()
    _fields_and_field_types: ClassVar[dict[str, str]] = {}

    def __init__(self) -> None:
        raise TypeError(f"{type(self).__name__}: without ROS messages are samples, made by css_common.codec")

    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]:
        """Names of the fields in order, and their types as generated classes write them."""
        return dict(cls._fields_and_field_types)


def classes_of(package: str) -> dict[str, type[MessageClass]]:
    """Classes of all messages of an installed package, by name.

    Raises:
        LookupError: the package is not installed, or has no messages.
    """
    files = sorted((share_folder(package) / "msg").glob("*.msg"))
    if not files:
        raise LookupError(f"package {package} has no messages in {share_folder(package) / 'msg'}")
    return {file.stem: message_class(package, file) for file in files}


def message_class(package: str, file: Path) -> type[MessageClass]:
    """The class of one `.msg` file."""
    types = get_types_from_msg(file.read_text(encoding="utf-8"), f"{package}/msg/{file.stem}")
    constants, fields = types[f"{package}/msg/{file.stem}"]
    slots = {name: _slot(kind) for name, kind in fields}
    members = {
        "__module__": f"{package}.msg",
        "__doc__": f"Message {package}/msg/{file.stem}.",
        "SLOT_TYPES": tuple(slots.values()),
        "_fields_and_field_types": {name: _text(slot) for name, slot in slots.items()},
        # generated classes have a byte as bytes
        **{name: bytes([int(value)]) if kind == "byte" else value for name, kind, value in constants},
    }
    return type(file.stem, (MessageClass,), members)


def _slot(kind: FieldDesc) -> Any:
    node: Nodetype = kind[0]
    content: Any = kind[1]
    if node == Nodetype.NAME:
        package, folder, name = content.split("/")
        return NamespacedType((package, folder), name)
    if node == Nodetype.BASE:
        name, bound = content
        if name == "string":
            return BoundedString(bound) if bound else UnboundedString()
        return BasicType(_IDL[name])
    element, count = content
    if node == Nodetype.ARRAY:
        return Array(_slot(element), count)
    return BoundedSequence(_slot(element), count) if count else UnboundedSequence(_slot(element))


def _text(slot: Any) -> str:
    if isinstance(slot, BasicType):
        return slot.typename
    if isinstance(slot, UnboundedString):
        return "string"
    if isinstance(slot, BoundedString):
        return f"string<{slot.maximum_size}>"
    if isinstance(slot, NamespacedType):
        return f"{slot.namespaces[0]}/{slot.name}"
    if isinstance(slot, Array):
        return f"{_text(slot.value_type)}[{slot.size}]"
    bound = f", {slot.maximum_size}" if isinstance(slot, BoundedSequence) else ""
    return f"sequence<{_text(slot.value_type)}{bound}>"
