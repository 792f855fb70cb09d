# SPDX-License-Identifier: Apache-2.0
"""Definition text and type hash of any installed message type, as recordings carry them.

A recording explains itself: each of its types comes with the text of its `.msg` file and of every type it is
made of (`ros2msg` encoding), and with the hash that ROS 2 computes over the same (RIHS01, REP-2016), so that
a reader can tell whether its own definition is the recorded one.
"""

import json
import re
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import FieldDesc, Typesdict
from rosbags.typesys import Stores, TypesysError, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from css_common.installed import share_folder
from css_recording.errors import BagError

_SEPARATOR = "=" * 80
_CHAR = re.compile(r"^\s*char\b", re.MULTILINE)
_STAMPED_FIRST = ("std_msgs/msg/Header", "builtin_interfaces/msg/Time")
_PRIMITIVES = frozenset(
    ["bool", "byte", "char", "string", "wstring", "float32", "float64"]
    + [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)]
)


class MessageSchema(NamedTuple):
    """What a recording says about a message type."""

    type_name: str  # "std_msgs/msg/Header"
    text: str  # definition with all dependencies; empty when it is not known
    type_hash: str  # "RIHS01_..."; empty when the source of the definition did not say
    encoding: str = "ros2msg"  # of the text: "ros2msg" or "ros2idl"


def split_type_name(type_name: str) -> tuple[str, str]:
    """Package and name of a message type such as "std_msgs/msg/Header"."""
    parts = type_name.split("/")
    if len(parts) != 3 or parts[1] != "msg" or not all(parts):
        raise BagError(f"'{type_name}' is not a message type; expected PACKAGE/msg/NAME")
    return parts[0], parts[2]


def full_type_name(type_name: str) -> str:
    """The name with its "/msg/", which older recorders leave out."""
    return type_name.replace("/", "/msg/") if type_name.count("/") == 1 else type_name


def dependencies(type_name: str, text: str) -> list[str]:
    """Full names of the types that the fields of one `.msg` text use, in order, each once."""
    package, _ = split_type_name(type_name)
    found: dict[str, None] = {}
    for line in text.splitlines():
        words = line.split("#", 1)[0].split()
        if not words:
            continue
        base = words[0].split("[", 1)[0].split("<=", 1)[0]
        if base in _PRIMITIVES:
            continue
        parts = base.split("/")
        found[f"{parts[0] if len(parts) > 1 else package}/msg/{parts[-1]}"] = None
    return list(found)


@cache
def schema_of(type_name: str) -> MessageSchema:
    """Schema of an installed message type; raises `BagError` when the type is not installed."""
    texts = {type_name: _definition_text(type_name)}
    waiting = dependencies(type_name, texts[type_name])
    while waiting:
        name = waiting.pop(0)
        if name not in texts:
            texts[name] = _definition_text(name)
            waiting += dependencies(name, texts[name])
    parts = [texts.pop(type_name)]
    for name, text in texts.items():
        parts.append(f"{_SEPARATOR}\nMSG: {'/'.join(split_type_name(name))}\n{text}")
    full_text = "\n".join(part.rstrip("\n") for part in parts) + "\n"
    return MessageSchema(type_name, full_text, _installed_hash(type_name) or hash_of(type_name, full_text))


def is_installed(type_name: str) -> bool:
    """Whether the definition of a message type is there."""
    try:
        schema_of(type_name)
    except BagError:
        return False
    return True


def header_place(schema: MessageSchema) -> int | None:
    """Where in a serialised message its stamp lies, counted from the beginning of the encapsulation [bytes].

    That of a message which begins with a Header or a Time, or with a list of such messages, as markers and transforms
    do: then that of the first of them. None: it begins with something else.
    """
    types = types_of(schema)
    fields = types[schema.type_name][1]
    if not fields:
        return None
    kind: FieldDesc = fields[0][1]
    if kind[0] == Nodetype.NAME:
        return 4 if kind[1] in _STAMPED_FIRST else None
    listed: Any = kind[1]
    if kind[0] != Nodetype.SEQUENCE or listed[0][0] != Nodetype.NAME:
        return None
    inner = types[str(listed[0][1])][1]
    begins = bool(inner) and inner[0][1][0] == Nodetype.NAME and inner[0][1][1] in _STAMPED_FIRST
    return 8 if begins else None  # behind the number of those that follow


def types_of(schema: MessageSchema) -> Typesdict:
    """Constants and fields of a type and of all that it is made of, as `rosbags` writes them.

    Raises `BagError` when the text cannot be understood.
    """
    try:
        if schema.encoding == "ros2idl":
            return _types_of_idl(schema.text)
        text = _CHAR.sub("uint8", schema.text)  # what ROS 2 makes of it; rosbags has it as a type of its own
        root, *others = text.split(f"{_SEPARATOR}\nMSG: ")
        types = dict(get_types_from_msg(root, schema.type_name))
        for other in others:
            name, _, definition = other.partition("\n")
            types.update(get_types_from_msg(definition, full_type_name(name.strip())))
        return types
    except (TypesysError, ValueError, RecursionError) as error:
        raise BagError(f"message type {schema.type_name}: its definition cannot be understood") from error


def _types_of_idl(text: str) -> Typesdict:
    types: Typesdict = {}
    for part in re.split(rf"^{_SEPARATOR}\nIDL: .*\n", text, flags=re.MULTILINE):
        types.update(get_types_from_idl(part.removeprefix(_SEPARATOR)) if part.strip() else {})
    return types


def store_of(types: Typesdict) -> Typestore:
    """A `rosbags` type store that holds these types alone."""
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    return store


def hash_of(type_name: str, text: str) -> str:
    """RIHS01 hash computed from a `ros2msg` schema text with all its dependencies."""
    return str(store_of(types_of(MessageSchema(type_name, text, ""))).hash_rihs01(type_name))


def _share_file(type_name: str, suffix: str) -> Path:
    package, name = split_type_name(type_name)
    try:
        return share_folder(package) / "msg" / f"{name}{suffix}"
    except LookupError as error:
        raise BagError(f"message type {type_name}: {error.args[0]}") from error


def _definition_text(type_name: str) -> str:
    path = _share_file(type_name, ".msg")
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise BagError(f"message type {type_name} is not installed: cannot read {path}") from error


def _installed_hash(type_name: str) -> str | None:
    """Hash that the message generators wrote beside the definition, if they did."""
    try:
        description = json.loads(_share_file(type_name, ".json").read_text(encoding="utf-8"))
    except OSError:
        return None
    for entry in description["type_hashes"]:
        if entry["type_name"] == type_name:
            return str(entry["hash_string"])
    return None
