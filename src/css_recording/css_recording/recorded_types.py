# SPDX-License-Identifier: Apache-2.0
"""Whether a recorded type is the installed one, and how its messages are brought into the installed form.

A recording says which type a topic has by name, by hash (RIHS01) and by definition. Two types of one name can differ:
read as the installed type, messages of another would give numbers that are wrong and look right. Where every field of
the installed type is in the recorded one, under the same name and with the same type, messages are converted by field
names; otherwise the topic is refused, with what differs.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import FieldDesc, Typesdict
from rosbags.typesys.store import Typestore

from css_recording.bag_metadata import Topic
from css_recording.errors import BagError
from css_recording.schemas import MessageSchema, full_type_name, schema_of, store_of, types_of

Conversion = Callable[[bytes], bytes]
"""Makes a message of the installed type of a recorded one; `ConversionError` when the bytes are no message."""

Layout = list[tuple[str, str]]
"""Fields of a message in order, those of messages in it included: path ("header.stamp.sec"), type."""


class ConversionError(Exception):
    """Bytes that are no message of the recorded type."""


class TypeMatch(NamedTuple):
    """How a recorded topic is to be read as an installed type.

    note: what could not be checked, or how it is converted; empty when the types are the same.
    conversion: None when messages can be taken as they are.
    """

    note: str = ""
    conversion: Conversion | None = None


def match_type(topic: Topic, expected: str) -> TypeMatch:
    """Compare the recorded type of a topic with an installed one; `BagError` when it cannot be read as that."""
    expected = full_type_name(expected)
    if full_type_name(topic.type) != expected:
        raise BagError(f"topic {topic.name} is {full_type_name(topic.type)}, expected {expected}")
    recorded, installed = topic.schema or MessageSchema(expected, "", ""), schema_of(expected)
    same_hash = recorded.type_hash == installed.type_hash
    if recorded.text == installed.text or (same_hash and not recorded.text):
        return TypeMatch()
    if not recorded.text:
        if recorded.type_hash:
            raise BagError(
                f"topic {topic.name}: {expected} was recorded with the hash {recorded.type_hash}, here it has "
                f"{installed.type_hash}; the recording holds no definition by which it could be converted"
            )
        return TypeMatch(f"topic {topic.name}: recorded without hash and definition, taken for the {expected} of here")
    return _match_definitions(topic.name, recorded, installed)


def _match_definitions(name: str, recorded: MessageSchema, installed: MessageSchema) -> TypeMatch:
    there, here = types_of(recorded), types_of(installed)
    type_name = installed.type_name
    if type_name not in there:
        raise BagError(f"topic {name}: the recorded definition of {type_name} defines other types")
    changed = _changed_constants(there, here)
    if changed:
        raise BagError(f"topic {name}: {type_name} was recorded with other constants: {', '.join(changed)}")
    old, new = layout_of(type_name, there), layout_of(type_name, here)
    if old == new:
        known = recorded.type_hash in ("", installed.type_hash)
        return TypeMatch("" if known else f"topic {name}: recorded with another hash, but with the fields of here")
    missing = [_lack(field, kind, dict(old)) for field, kind in new if (field, kind) not in old]
    if missing:
        raise BagError(f"topic {name}: {type_name} was recorded with another definition: {', '.join(missing)}")
    extra = [field for field, _ in old if field not in dict(new)]
    how = f"without its {', '.join(extra)}" if extra else "whose order was another"
    note = f"topic {name}: recorded with another definition of {type_name}, converted by field names, {how}"
    return TypeMatch(note, _conversion(type_name, there, here))


def layout_of(type_name: str, types: Typesdict) -> Layout:
    """Fields of a type, those of types in it included."""
    fields: Layout = []
    for name, kind in types[type_name][1]:
        if kind[0] == Nodetype.NAME:
            fields += [(f"{name}.{inner}", text) for inner, text in layout_of(str(kind[1]), types)]
        else:
            fields.append((name, _text_of(kind, types)))
    return fields


def _text_of(kind: FieldDesc, types: Typesdict) -> str:
    node: Nodetype = kind[0]
    content: Any = kind[1]
    if node == Nodetype.BASE:
        name, bound = content
        return f"{name}<={bound}" if bound else str(name)
    if node == Nodetype.NAME:
        inner = ", ".join(f"{text} {name}" for name, text in layout_of(str(content), types))
        return f"({inner})"
    element, count = content
    text = _text_of(element, types)
    if node == Nodetype.ARRAY:
        return f"{text}[{count}]"
    return f"{text}[<={count}]" if count else f"{text}[]"


def _changed_constants(there: Typesdict, here: Typesdict) -> list[str]:
    """Constants of one name and another value: what a field means by a number."""
    changed = []
    for type_name in here.keys() & there.keys():
        recorded = {name: value for name, _, value in there[type_name][0]}
        for name, _, value in here[type_name][0]:
            if recorded.get(name, value) != value:
                changed.append(f"{name} = {recorded[name]}, here {value}")
    return sorted(changed)


def _lack(field: str, kind: str, old: dict[str, str]) -> str:
    return f"{field} is {old[field]}, here {kind}" if field in old else f"it lacks {field}"


def _conversion(type_name: str, there: Typesdict, here: Typesdict) -> Conversion:
    old, new = store_of(there), store_of(here)

    def convert(data: bytes) -> bytes:
        try:
            message = old.deserialize_cdr(data, type_name)
        except Exception as error:  # whatever rosbags meets in bytes that are no message
            raise ConversionError(f"it is no {type_name} as recorded ({type(error).__name__})") from error
        return bytes(new.serialize_cdr(_rebuilt(message, type_name, new), type_name))

    return convert


def _rebuilt(message: Any, type_name: str, store: Typestore) -> Any:
    """The same values in a message of another definition."""

    def value_of(kind: FieldDesc, value: Any) -> Any:
        node, content = kind
        if node == Nodetype.NAME:
            return _rebuilt(value, str(content), store)
        if node in (Nodetype.ARRAY, Nodetype.SEQUENCE) and content[0][0] == Nodetype.NAME:
            return [_rebuilt(element, str(content[0][1]), store) for element in value]
        return value

    fields = store.fielddefs[type_name][1]
    return store.types[type_name](**{name: value_of(kind, getattr(message, name)) for name, kind in fields})
