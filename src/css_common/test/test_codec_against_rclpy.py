# SPDX-License-Identifier: Apache-2.0
"""The codec against rclpy's serialiser and, as that leaves padding uninitialised, against the one of `rosbags`."""

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ament_index_python.packages import get_package_share_directory
from geometry_msgs.msg import PoseStamped, Vector3Stamped
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from sensor_msgs.msg import Imu, JointState, MagneticField
from std_msgs.msg import Float64

import css_msgs.msg
from css_common.codec import Sample, codec_of, stamp_of

OWN = [t for t in vars(css_msgs.msg).values() if isinstance(t, type)]
TYPES = [*OWN, Imu, MagneticField, PoseStamped, Vector3Stamped]
by_type = pytest.mark.parametrize("message_type", TYPES, ids=lambda t: t.__name__)


def _rosbags_types():
    store = get_typestore(Stores.ROS2_JAZZY)
    for file in Path(get_package_share_directory("css_msgs"), "msg").glob("*.msg"):
        store.register(get_types_from_msg(file.read_text(encoding="utf-8"), f"css_msgs/msg/{file.stem}"))
    return store


ROSBAGS = _rosbags_types()

frames = st.one_of(
    st.text(st.characters(min_codepoint=33, max_codepoint=126), max_size=40),
    st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=63),
    st.integers(0, 255).map("f".__mul__),
)
doubles = st.floats(allow_nan=False)
integers = {
    "int32": st.integers(-(2**31), 2**31 - 1),
    "uint8": st.integers(0, 2**8 - 1),
    "uint32": st.integers(0, 2**32 - 1),
}


def leaf(type_name: str) -> st.SearchStrategy:
    """Values of a field of numbers: `double`, `uint8`, `double[9]`, `sequence<double>`."""
    if type_name.startswith("sequence<"):
        return st.lists(leaf(type_name[9:-1]), max_size=40)
    if type_name.endswith("]"):
        element, _, length = type_name[:-1].partition("[")
        return st.lists(leaf(element), min_size=int(length), max_size=int(length))
    return doubles if type_name == "double" else integers[type_name]


def fill(data: st.DataObject, message: Any, frame: str) -> None:
    """Draws every field of a rclpy message, nested ones included."""
    for name, type_name in message.get_fields_and_field_types().items():
        if name == "header":
            message.header.frame_id = frame
            message.header.stamp.sec = data.draw(st.integers(-(2**31), 2**31 - 1))
            message.header.stamp.nanosec = data.draw(st.integers(0, 999_999_999))
        elif "/" in type_name:
            fill(data, getattr(message, name), frame)
        else:
            setattr(message, name, data.draw(leaf(type_name)))


def numbers(value: Any) -> list:
    """All numbers of a field of a rclpy message in order."""
    if hasattr(value, "get_fields_and_field_types"):
        return [number for name in value.get_fields_and_field_types() for number in numbers(getattr(value, name))]
    return list(value) if hasattr(value, "__len__") else [value]


def assert_same(sample: Sample, message: Any) -> None:
    """Every field of a decoded sample is that of the rclpy message, to the bit."""
    stamp = message.header.stamp
    assert sample.stamp_ns == stamp.sec * 1_000_000_000 + stamp.nanosec
    assert sample.frame_id == message.header.frame_id
    names = list(message.get_fields_and_field_types())[1:]
    assert list(vars(sample)) == ["stamp_ns", "frame_id", *names]
    for name in names:
        field = getattr(sample, name)
        assert np.atleast_1d(field).tolist() == numbers(getattr(message, name)), name


def to_rosbags(message: Any) -> Any:
    """The same message as an object of `rosbags`."""
    kind = type(message)
    type_name = f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"
    fields = {}
    for name, field_type in message.get_fields_and_field_types().items():
        value = getattr(message, name)
        if "/" in field_type:
            value = to_rosbags(value)
        elif not isinstance(value, (int, float, str)):
            value = np.array(value, dtype=np.uint32 if "uint32" in field_type else np.float64)
        fields[name] = value
    return ROSBAGS.types[type_name](**fields)


def value_bytes(message: Any, at: int = 0) -> Iterator[tuple[int, int]]:
    """Start and end, behind the encapsulation, of everything in a serialised message that is no padding."""
    sizes = {"double": 8, "uint8": 1, "uint32": 4, "int32": 4}

    def walk(value: Any, type_name: str) -> Iterator[tuple[int, int]]:
        nonlocal at
        if "/" in type_name:
            for name, inner in value.get_fields_and_field_types().items():
                yield from walk(getattr(value, name), inner)
            return
        if type_name == "string":
            yield from walk(0, "uint32")
            length = len(value.encode()) + 1
            yield at, at + length
            at += length
            return
        sequence, fixed = type_name.startswith("sequence<"), type_name.endswith("]")
        if sequence or fixed:
            if sequence:
                yield from walk(0, "uint32")
            element = type_name[9:-1] if sequence else type_name.partition("[")[0]
            for item in value:
                yield from walk(item, element)
            return
        size = sizes[type_name]
        at += -at % size
        yield at, at + size
        at += size

    for name, inner in message.get_fields_and_field_types().items():
        yield from walk(getattr(message, name), inner)


@by_type
@given(data=st.data(), frame=frames)
def test_decodes_what_rclpy_serialises(message_type, data, frame):
    message = message_type()
    fill(data, message, frame)
    serialised = serialize_message(message)
    assert_same(codec_of(message_type).decode(serialised), message)
    assert stamp_of(serialised) == codec_of(message_type).decode(serialised).stamp_ns


@by_type
@given(data=st.data(), frame=frames)
def test_rclpy_deserialises_what_is_encoded(message_type, data, frame):
    message = message_type()
    fill(data, message, frame)
    codec = codec_of(message_type)
    encoded = codec.encode(codec.decode(serialize_message(message)))
    assert deserialize_message(encoded, message_type) == message


@by_type
@given(data=st.data(), frame=frames)
def test_bytes_are_those_of_rosbags_and_but_for_padding_those_of_rclpy(message_type, data, frame):
    message = message_type()
    fill(data, message, frame)
    codec = codec_of(message_type)
    theirs = serialize_message(message)
    ours = codec.encode(codec.decode(theirs))
    zero_padded = bytes(ROSBAGS.serialize_cdr(to_rosbags(message), codec.type_name))
    assert ours == zero_padded + bytes(-len(zero_padded) % 4), "padding is zero in both; the end is filled up to four"
    assert ours[:4] == theirs[:4]
    end = 0
    for start, end in value_bytes(message):
        assert ours[4 + start : 4 + end] == theirs[4 + start : 4 + end]
    assert len(zero_padded) == 4 + end


@pytest.mark.parametrize("message_type", OWN, ids=lambda t: t.__name__)
def test_own_messages_have_no_padding_before_their_last_double_with_the_default_frames(message_type):
    # so that other serialisers, which leave padding as they find it, give equal bytes for equal messages too
    for frame in ("bus", "eci"):
        message = message_type()
        message.header.frame_id = frame
        spans = list(value_bytes(message))
        gaps = [(a, b) for (_, a), (b, _) in pairwise(spans) if a != b]
        assert not gaps


@by_type
@given(data=st.data(), frame=frames)
def test_equal_samples_are_equal_bytes_from_arrays_lists_and_tuples(message_type, data, frame):
    message = message_type()
    fill(data, message, frame)
    codec = codec_of(message_type)
    sample = codec.decode(serialize_message(message))
    expected = codec.encode(sample)
    for convert in (lambda a: np.array(a)[::1].copy(), np.ndarray.tolist, lambda a: tuple(a.tolist())):
        fields = {
            name: convert(value) if isinstance(value, np.ndarray) else value
            for name, value in vars(sample).items()
            if name not in ("stamp_ns", "frame_id")
        }
        assert codec.encode(Sample(sample.stamp_ns, sample.frame_id, **fields)) == expected


@by_type
def test_not_a_number_passes_and_is_found(message_type):
    codec = codec_of(message_type)
    assert codec.first_not_finite(codec.real_fields(), codec.sample(0, "bus")) is None
    for field in codec.real_fields():
        for bad in (float("nan"), float("inf"), -float("inf")):
            sample = codec.sample(0, "bus")
            setattr(sample, field.name, bad if field.count is None else np.full(field.count or 3, bad))
            again = codec.decode(codec.encode(sample))
            assert codec.first_not_finite(codec.real_fields(), again) == field.name
            others = tuple(f.name for f in codec.real_fields() if f.name != field.name)
            if others:
                assert codec.first_not_finite(codec.real_fields(others), again) is None


@by_type
def test_sample_of_zeros_is_the_fresh_message_of_rclpy(message_type):
    codec = codec_of(message_type)
    message = deserialize_message(codec.encode(codec.sample(0, "")), message_type)
    fresh = message_type()
    for name in list(fresh.get_fields_and_field_types())[1:]:
        value = getattr(fresh, name)
        if hasattr(value, "w"):
            continue  # a fresh quaternion of ROS is the identity, not zeros
        if name != "pose":
            assert numbers(getattr(message, name)) == numbers(value)


def test_unknown_fields_are_named():
    codec = codec_of(css_msgs.msg.WheelTorqueCommand)
    with pytest.raises(TypeError, match="css_msgs/msg/WheelTorqueCommand has no field torques"):
        codec.sample(0, "bus", torques=np.zeros(4))
    with pytest.raises(AttributeError, match="'torques'"):
        _ = codec.sample(0, "bus").torques


def test_wrong_length_of_a_fixed_array_is_named():
    codec = codec_of(css_msgs.msg.SunEstimate)
    sample = codec.sample(0, "bus", sun_b=np.zeros(4))
    with pytest.raises(ValueError, match=r"SunEstimate\.sun_b: 4 values given, the type has 3"):
        codec.encode(sample)


@pytest.mark.parametrize(
    ("message_type", "reason"),
    [(Float64, "does not begin with a std_msgs/Header"), (JointState, r"JointState\.name: .* is not a number")],
)
def test_types_of_another_form_are_refused(message_type, reason):
    with pytest.raises(TypeError, match=reason):
        codec_of(message_type)


def test_decoded_doubles_are_aligned_contiguous_and_writable():
    # the one form for which kernels are compiled
    codec = codec_of(css_msgs.msg.SpacecraftState)
    for frame in ("", "b", "bus", "body", "spacecraft_body"):
        for value in vars(codec.decode(codec.encode(codec.sample(1, frame)))).values():
            if isinstance(value, np.ndarray):
                assert value.flags.c_contiguous
                assert value.flags.writeable
                assert value.flags.aligned == (value.ctypes.data % 8 == 0)
    state = codec.decode(codec.encode(codec.sample(1, "eci")))
    assert state.r_n.flags.aligned
