# SPDX-License-Identifier: Apache-2.0
"""Classes made from `.msg` files say of their messages what the classes say that ROS generates."""

import importlib
from pathlib import Path

import pytest

from css_common.codec import Codec
from css_common.installed import share_folder
from css_common.message_classes import MessageClass, classes_of, message_class

PACKAGES = (
    "css_msgs", "std_msgs", "builtin_interfaces", "geometry_msgs", "sensor_msgs", "diagnostic_msgs", "rcl_interfaces",
    "shape_msgs",
)  # fmt: skip
COMMON = Path(__file__).parents[2] / "css_msgs" / "common_interfaces"


def generated(package):
    return vars(importlib.import_module(f"{package}.msg"))


def parts(slot):
    """What a slot type is made of: ours are tuples, those of ROS objects with the same attributes."""
    names = ("typename", "size", "maximum_size", "name")
    told = {name: getattr(slot, name) for name in names if hasattr(slot, name)}
    if hasattr(slot, "namespaces"):
        told["namespaces"] = tuple(slot.namespaces)
    if hasattr(slot, "value_type"):
        told["value_type"] = parts(slot.value_type)
    return type(slot).__name__, told


def constants(message_type):
    # those of generated classes are properties of the class's own class
    own = [
        name
        for name in {**vars(type(message_type)), **vars(message_type)}
        if name.isupper() and not name.startswith("_")
    ]
    return {name: getattr(message_type, name) for name in own if not name.endswith(("TYPES", "__DEFAULT"))}


@pytest.mark.parametrize("package", PACKAGES)
def test_fields_types_and_constants(package):
    theirs = generated(package)
    made = classes_of(package)
    assert len(made) >= 2
    for name, ours in made.items():
        assert ours.get_fields_and_field_types() == theirs[name].get_fields_and_field_types()
        assert [*map(parts, ours.SLOT_TYPES)] == [*map(parts, theirs[name].SLOT_TYPES)]
        assert constants(ours) == constants(theirs[name])


def test_bytes_are_those_of_the_codec_of_a_generated_class():
    for name, ours in classes_of("css_msgs").items():
        codec, theirs = Codec(ours), Codec(generated("css_msgs")[name])
        assert codec.type_name == theirs.type_name == f"css_msgs/msg/{name}"
        arrays = {field: [1.0, 2.0, 3.0] for field in codec.array_fields()}
        ours_sent, theirs_sent = (c.sample(1_700_000_000_123_456_789, "bus", **arrays) for c in (codec, theirs))
        assert codec.encode(ours_sent) == theirs.encode(theirs_sent)


@pytest.mark.parametrize("file", sorted(COMMON.glob("*/msg/*.msg")), ids=lambda file: file.stem)
def test_copies_are_what_ros_has(file):
    package = file.parts[-3]
    assert file.read_bytes() == (share_folder(package) / "msg" / file.name).read_bytes()


def test_strings_and_bounds(tmp_path):
    file = tmp_path / "Odd.msg"
    file.write_text(
        'string<=10 label "none"\nstring[] names\nfloat32[<=3] few\nbyte[2] raw\nOther other\nint8 LAST=-1\n'
    )
    made = message_class("odd_msgs", file)
    assert made.get_fields_and_field_types() == {
        "label": "string<10>", "names": "sequence<string>", "few": "sequence<float, 3>", "raw": "octet[2]",
        "other": "odd_msgs/Other",
    }  # fmt: skip
    assert constants(made)["LAST"] == -1
    assert issubclass(made, MessageClass)
    with pytest.raises(TypeError, match="without ROS messages are samples"):
        made()


@pytest.mark.parametrize("name", ["no_such_msgs", "../css_msgs", ""])
def test_what_is_not_installed_is_named(name):
    with pytest.raises(LookupError, match="is not installed"):
        classes_of(name)
