# SPDX-License-Identifier: Apache-2.0
"""Damaged bytes: the codec says DecodeError or gives a sample, and never anything else, nor takes memory for it."""

import struct
import tracemalloc

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from hypothesis import given
from hypothesis import strategies as st
from presence import present
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Imu, MagneticField

import css_msgs.msg
from css_common.codec import MAX_ELEMENTS, Codec, DecodeError, Sample, codec_of

TYPES = [*(t for t in vars(css_msgs.msg).values() if isinstance(t, type)), Imu, MagneticField, PoseStamped]
by_type = pytest.mark.parametrize("message_type", TYPES, ids=lambda t: t.__name__)


def good(codec: Codec, frame: str = "bus", elements: int = 8) -> bytes:
    """A message with something in every field, without the zeros that fill its end up to four bytes."""
    arrays = {name: np.linspace(0.1, 1.0, elements) for name in codec.array_fields()}
    small = {f.name: 1 for f in codec.fields if f.code == "B"}
    data = codec.encode(codec.sample(1_370_044_800_100_000_000, frame, **arrays, **small))
    return data.rstrip(b"\0") if small else data


def decoded(codec: Codec, data: bytes) -> Sample | None:
    """The sample in some bytes, None where the codec refuses them; anything else it may raise fails the test."""
    try:
        return codec.decode(data)
    except DecodeError as error:
        assert codec.type_name in str(error)
        assert "\n" not in str(error)
        return None


@by_type
def test_every_truncation_is_refused(message_type):
    codec = codec_of(message_type)
    whole = good(codec)
    for length in range(len(whole)):
        assert decoded(codec, whole[:length]) is None


@by_type
def test_extension_beyond_alignment_is_refused(message_type):
    codec = codec_of(message_type)
    whole = good(codec)
    for extra in range(8):
        assert present(decoded(codec, whole + bytes(extra))).stamp_ns == 1_370_044_800_100_000_000
    for extra in (8, 9, 100, 10_000):
        assert decoded(codec, whole + bytes(extra)) is None


@by_type
def test_every_single_bit_flip_is_survived(message_type):
    codec = codec_of(message_type)
    whole = bytearray(good(codec, elements=2))
    for i in range(len(whole) * 8):
        whole[i // 8] ^= 1 << i % 8
        decoded(codec, bytes(whole))
        whole[i // 8] ^= 1 << i % 8


@by_type
@given(data=st.binary(max_size=400))
def test_random_bytes_are_survived(message_type, data):
    decoded(codec_of(message_type), data)


@by_type
@given(data=st.binary(max_size=400))
def test_random_bytes_behind_a_right_encapsulation_are_survived(message_type, data):
    decoded(codec_of(message_type), b"\x00\x01\x00\x00" + data)


@by_type
@given(st.data())
def test_several_damages_at_once_are_survived(message_type, data):
    codec = codec_of(message_type)
    whole = bytearray(good(codec, data.draw(st.text(st.characters(exclude_categories=["Cs"]), max_size=12))))
    for _ in range(data.draw(st.integers(1, 6))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    decoded(codec, bytes(whole[: data.draw(st.integers(0, len(whole)))]))


@by_type
@pytest.mark.parametrize("encapsulation", ["00000000", "00030000", "00020000", "00070000", "01000000", "ffffffff", ""])
def test_other_encapsulations_are_refused(message_type, encapsulation):
    # big endian, parameter lists, XCDR2
    codec = codec_of(message_type)
    assert decoded(codec, bytes.fromhex(encapsulation) + good(codec)[4:]) is None


def test_big_endian_is_named():
    codec = codec_of(Imu)
    with pytest.raises(DecodeError, match="encapsulation 00000000 is not little-endian CDR"):
        codec.decode(bytes(4) + good(codec)[4:])


@by_type
@pytest.mark.parametrize("claimed", [MAX_ELEMENTS, MAX_ELEMENTS + 1, 2**31 - 1, 2**31, 2**32 - 1])
def test_huge_length_fields_take_no_memory(message_type, claimed):
    codec = codec_of(message_type)
    whole = good(codec)
    codec.decode(whole)
    positions = range(12, len(whole) - 3, 4)  # the frame's length, every array's, and every other number
    tracemalloc.start()
    for at in positions:
        decoded(codec, whole[:at] + struct.pack("<I", claimed) + whole[at + 4 :])
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 100 * len(whole) + 20_000


def test_claimed_lengths_are_named():
    codec = codec_of(css_msgs.msg.WheelTorqueCommand)
    whole = good(codec, elements=1)
    count = len(whole) - 12
    with pytest.raises(DecodeError, match=rf"torque: {MAX_ELEMENTS + 1} elements"):
        codec.decode(whole[:count] + struct.pack("<I", MAX_ELEMENTS + 1) + whole[count + 4 :])


@by_type
@pytest.mark.parametrize("nanoseconds", [1_000_000_000, 2**32 - 1])
def test_stamp_with_more_than_a_second_of_nanoseconds_is_refused(message_type, nanoseconds):
    codec = codec_of(message_type)
    whole = good(codec)
    with pytest.raises(DecodeError, match="the header is damaged"):
        codec.decode(whole[:8] + struct.pack("<I", nanoseconds) + whole[12:])


def test_frame_that_is_no_text_is_refused():
    codec = codec_of(css_msgs.msg.CssVoltages)
    whole = good(codec)
    assert decoded(codec, whole.replace(b"bus\0", b"\xff\xfe\xfd\0")) is None


def test_another_type_of_message_is_refused_where_the_layouts_differ():
    serialised = serialize_message(Imu())
    for message_type in TYPES:
        if message_type is not Imu:
            assert decoded(codec_of(message_type), serialised) is None
