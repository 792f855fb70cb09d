# SPDX-License-Identifier: Apache-2.0
"""Frames of a board in the loop: what is written is read from any stream, and nothing damaged is taken for one."""

import math
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from css_drivers import hil_frame, hil_header
from css_drivers.hil_frame import (
    HEADER_BYTES,
    KIND_COMMAND,
    KIND_SENSORS,
    LONGEST,
    SYNC,
    Command,
    FrameError,
    FrameReader,
    Sensors,
    command_frame,
    command_of,
    payload_bytes,
    sensors_frame,
)

ROOT = Path(__file__).parents[3]
numbers = st.floats(width=32, allow_nan=False, allow_infinity=False)
threes = st.tuples(numbers, numbers, numbers)
rows = st.lists(numbers, max_size=32).map(tuple)
commands = st.builds(Command, st.integers(0, 1), threes, rows, rows)
sensors = st.builds(
    Sensors, st.integers(0, 7), st.integers(0, 2**32 - 1), threes, threes, rows, rows, st.integers(0, 32)
)
sequences, stamps = st.integers(0, 2**32 - 1), st.integers(0, 2**64 - 1)


@given(sequences, stamps, commands)
def test_command_is_read_as_it_was_written(sequence, stamp, command):
    reader = FrameReader()
    (frame,) = reader.feed(command_frame(sequence, stamp, command))
    assert (frame.kind, frame.sequence, frame.stamp_ns) == (KIND_COMMAND, sequence, stamp)
    assert command_of(frame, len(command.torque), len(command.dipole)) == command
    assert (reader.corrupt, reader.skipped) == (0, 0)


@given(sequences, stamps, sensors)
def test_sensors_are_read_as_they_were_written(sequence, stamp, told):
    data = sensors_frame(sequence, stamp, told)
    assert len(data) == HEADER_BYTES + 4 + payload_bytes(
        KIND_SENSORS, cells=len(told.cell), wheels=len(told.wheel_speed)
    )
    (frame,) = FrameReader().feed(data)
    assert Sensors(*(frame.values[name] for name in Sensors._fields)) == told


def test_bytes_are_those_of_the_description():
    """Packed by hand, from the tables of docs/hil.md."""
    told = Sensors(5, 100_000, (0.5, -0.25, 2.0), (1e-5, 0.0, 0.0), (1.0, math.nan), (100.0,), 3)
    payload = struct.pack("<BBBBI3f3f2f1f", 5, 2, 1, 3, 100_000, 0.5, -0.25, 2.0, 1e-5, 0.0, 0.0, 1.0, math.nan, 100.0)
    inner = struct.pack("<BBHIQ", 1, 1, len(payload), 7, 123_456_789_000) + payload
    expected = b"\x53\xa7" + inner + struct.pack("<I", zlib.crc32(inner))
    assert sensors_frame(7, 123_456_789_000, told) == expected


def test_numbers_that_32_bits_do_not_hold_do_no_harm():
    told = Sensors(1, 1, (1e300, -1e300, 0.0), (0.0,) * 3, (math.nan,), (), 0)
    (frame,) = FrameReader().feed(sensors_frame(0, 0, told))
    assert np.all(np.isfinite(frame.values["gyro"]))
    assert math.isnan(frame.values["cell"][0])


@given(st.lists(st.binary(max_size=60) | commands, max_size=6), st.lists(st.integers(1, 50)))
def test_frames_are_found_in_any_stream_however_its_bytes_come(parts, cuts):
    stream, expected = b"", []
    for k, part in enumerate(parts):
        if isinstance(part, bytes):
            # noise without a sync, nor half of one at its end: what looks like a frame may cost the next one
            stream += part.replace(b"\x53", b"\x54")
        else:
            stream += command_frame(k, k, part)
            expected.append(k)
    reader, found, at = FrameReader(), [], 0
    for cut in [*cuts, len(stream)]:
        found += reader.feed(stream[at : at + cut])
        at += cut
    assert [frame.sequence for frame in found] == expected
    assert reader.corrupt == 0


@given(st.binary(max_size=2000), st.booleans())
def test_no_bytes_do_harm(data, synchronised):
    reader = FrameReader()
    for frame in reader.feed(SYNC + data if synchronised else data):
        assert len(data) >= HEADER_BYTES + 2, frame
    assert reader.skipped <= len(data) + 2
    for _ in range(len(data)):
        reader.give_up_waiting()
    assert len(reader._held) <= HEADER_BYTES + LONGEST + 4


@given(commands, st.data())
def test_no_flipped_bit_passes(command, data):
    frame = bytearray(command_frame(3, 4, command))
    at = data.draw(st.integers(0, 8 * len(frame) - 1))
    frame[at // 8] ^= 1 << at % 8
    assert FrameReader().feed(bytes(frame)) == []


@given(commands, commands, st.integers(1, 30))
def test_cut_frame_costs_itself_alone_once_it_is_given_up(first, second, kept):
    reader = FrameReader()
    assert reader.feed(command_frame(1, 1, first)[:kept]) == []
    reader.give_up_waiting()
    reader.give_up_waiting()
    found = reader.feed(command_frame(2, 2, second))
    for _ in range(2):
        found += reader.give_up_waiting()
    # a tail of the cut one may hold a sync by chance; nearly always the next frame is there at once
    assert [frame.sequence for frame in found] == [2] or SYNC in command_frame(1, 1, first)[2:]


@pytest.mark.parametrize(
    "command",
    [
        Command(0, (0.0,) * 3, (0.0,), ()),
        Command(0, (0.0,) * 3, (0.0, 0.0), (1.0,)),
        Command(0, (0.0,) * 3, (0.0, math.nan), ()),
        Command(1, (math.nan, 0.0, 0.0), (0.0, 0.0), ()),
    ],
)
def test_command_that_nothing_can_be_commanded_by_is_refused(command):
    (frame,) = FrameReader().feed(command_frame(0, 0, command))
    with pytest.raises(FrameError):
        command_of(frame, 2, 0)


def test_payload_that_contradicts_itself_is_corrupt():
    whole = command_frame(0, 0, Command(0, (0.0,) * 3, (0.0,), ()))
    inner = bytearray(whole[2:-4])
    inner[17] = 2  # two wheels, with the bytes of one
    reader = FrameReader()
    assert reader.feed(SYNC + bytes(inner) + struct.pack("<I", zlib.crc32(inner))) == []
    assert reader.corrupt == 1


def test_header_for_c_and_tables_are_made_of_the_one_description():
    told = (ROOT / "src/css_drivers/clients/hil_frame.h").read_text(encoding="utf-8")
    assert told == hil_header.c_header(), "python -m css_drivers.hil_header writes it anew"
    page = (ROOT / "docs/hil.md").read_text(encoding="utf-8")
    assert hil_header.tables() in page
    assert f"`{SYNC[0]:#04x} {SYNC[1]:#04x}`" in page
    assert f"at most {hil_frame.MOST_UNITS}" in page
