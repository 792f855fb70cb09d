# SPDX-License-Identifier: Apache-2.0
"""Frames between the simulation and a board: the one description of their bytes, and what reads and writes them.

Little endian throughout. `HEADER`, `SENSORS` and `COMMAND` say all; docs/hil.md and the header for C
(`hil_header`) are made of them. A frame is

    sync | header | payload | CRC-32 of header and payload (IEEE 802.3, as zlib has it)
"""

import math
import struct
import zlib
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

SYNC = b"\x53\xa7"
VERSION = 1
KIND_SENSORS, KIND_COMMAND = 1, 2
MOST_UNITS = 32
"""Cells, wheels or rods of a frame."""


class Field(NamedTuple):
    """One field of a frame."""

    name: str
    code: str  # of struct: B, H, I, Q, f
    elements: int | str  # of elements, or the name of the field before it that says it
    unit: str
    meaning: str


HEADER = (
    Field("version", "B", 1, "-", f"of this format: {VERSION}"),
    Field("kind", "B", 1, "-", f"{KIND_SENSORS}: sensors, to the board; {KIND_COMMAND}: command, from the board"),
    Field("length", "H", 1, "bytes", "of the payload"),
    Field("sequence", "I", 1, "-", "of the sensors; a command bears that of the sensors it answers"),
    Field("stamp", "Q", 1, "ns", "simulated UTC since 1970; a command bears that of the sensors it answers"),
)
HAS_GYRO, HAS_FIELD, HAS_WHEELS = 1 << 0, 1 << 1, 1 << 2
SENSORS = (
    Field("flags", "B", 1, "-", f"what was measured: {HAS_GYRO} gyro, {HAS_FIELD} field, {HAS_WHEELS} wheel speeds"),
    Field("cells", "B", 1, "-", "number of cells"),
    Field("wheels", "B", 1, "-", "number of wheels"),
    Field("rods", "B", 1, "-", "number of rods, none of which measures anything"),
    Field("period", "I", 1, "us", "control cycle"),
    Field("gyro", "f", 3, "rad/s", "body rate; zeros without"),
    Field("field", "f", 3, "T", "magnetic field in the body; zeros without"),
    Field("cell", "f", "cells", "-", "outputs of the cells, 1: the Sun at normal incidence; NaN: no output"),
    Field("wheel_speed", "f", "wheels", "rad/s", "relative to the body; zeros without"),
)
HAS_SUN = 1 << 0
COMMAND = (
    Field("flags", "B", 1, "-", f"what is told: {HAS_SUN} the board's own direction to the Sun"),
    Field("wheels", "B", 1, "-", "number of wheels, as in the sensors"),
    Field("rods", "B", 1, "-", "number of rods, as in the sensors"),
    Field("reserved", "B", 1, "-", "0"),
    Field("sun", "f", 3, "-", "unit vector to the Sun in the body; zeros without"),
    Field("torque", "f", "wheels", "N m", "motor torque of each wheel; the reaction on the body is the opposite"),
    Field("dipole", "f", "rods", "A m^2", "dipole of each rod"),
)
PAYLOADS = {KIND_SENSORS: SENSORS, KIND_COMMAND: COMMAND}

_HEADER = struct.Struct("<" + "".join(field.code for field in HEADER))
HEADER_BYTES = len(SYNC) + _HEADER.size
CRC_BYTES = 4
_LARGEST = float(np.finfo(np.float32).max)  # a message that was damaged on its way may hold more


class FrameError(ValueError):
    """Bytes that are no frame."""


class Sensors(NamedTuple):
    """What a board is told each cycle."""

    flags: int
    period: int  # [us]
    gyro: Sequence[float]
    field: Sequence[float]
    cell: Sequence[float]
    wheel_speed: Sequence[float]
    rods: int


class Command(NamedTuple):
    """What a board answers."""

    flags: int
    sun: Sequence[float]
    torque: Sequence[float]
    dipole: Sequence[float]


class Frame(NamedTuple):
    """A frame as it came: its kind, and the values of its payload by name."""

    kind: int
    sequence: int
    stamp_ns: int
    values: dict[str, Any]  # a number, or a tuple of them


def payload_bytes(kind: int, **counts: int) -> int:
    """Length of a payload with so many `cells`, `wheels`, `rods`."""
    return sum(
        struct.calcsize(f.code) * (f.elements if isinstance(f.elements, int) else counts[f.elements])
        for f in PAYLOADS[kind]
    )


LONGEST = max(payload_bytes(kind, cells=MOST_UNITS, wheels=MOST_UNITS, rods=MOST_UNITS) for kind in PAYLOADS)
"""Bytes of the longest payload."""


def sensors_frame(sequence: int, stamp_ns: int, told: Sensors) -> bytes:
    """The frame to a board."""
    given = told._asdict() | {"cells": len(told.cell), "wheels": len(told.wheel_speed)}
    return _frame(KIND_SENSORS, sequence, stamp_ns, given)


def command_frame(sequence: int, stamp_ns: int, command: Command) -> bytes:
    """The frame of a board, for tests and for boards in Python."""
    given = command._asdict() | {"wheels": len(command.torque), "rods": len(command.dipole), "reserved": 0}
    return _frame(KIND_COMMAND, sequence, stamp_ns, given)


def _frame(kind: int, sequence: int, stamp_ns: int, given: dict) -> bytes:
    code, values = "<", list[float]()
    for field in PAYLOADS[kind]:
        value = given[field.name]
        elements = (value,) if field.elements == 1 else tuple(value)
        if field.code == "f":
            elements = tuple(map(_held_by_32_bits, elements))
        code += f"{len(elements)}{field.code}"
        values += elements
    payload = struct.pack(code, *values)
    inner = _HEADER.pack(VERSION, kind, len(payload), sequence & 0xFFFFFFFF, stamp_ns) + payload
    return SYNC + inner + struct.pack("<I", zlib.crc32(inner))


def _held_by_32_bits(value: float) -> float:
    return value if value != value else max(-_LARGEST, min(_LARGEST, value))


def parse_payload(kind: int, payload: bytes) -> dict[str, Any]:
    """The values of a payload by name.

    Raises:
        FrameError: its length is not what it says of itself, or a number is too large.
    """
    values: dict[str, Any] = {}
    at = 0
    for field in PAYLOADS[kind]:
        count = field.elements if isinstance(field.elements, int) else int(values[field.elements])
        code = struct.Struct(f"<{count}{field.code}")
        if at + code.size > len(payload):
            raise FrameError(f"{len(payload)} bytes of payload end before {field.name}")
        given = code.unpack_from(payload, at)
        if field.name in ("cells", "wheels", "rods") and given[0] > MOST_UNITS:
            raise FrameError(f"{field.name}: {given[0]} given, expected at most {MOST_UNITS}")
        values[field.name] = given[0] if field.elements == 1 else given
        at += code.size
    if at != len(payload):
        raise FrameError(f"{len(payload)} bytes of payload given, it says of itself that it has {at}")
    return values


class FrameReader:
    """Finds frames in a stream of bytes that may begin anywhere, lose bytes and hold others.

    Attributes:
        corrupt: frames whose CRC, length, version or contents are wrong.
        skipped: bytes that belong to no frame.
    """

    def __init__(self) -> None:
        self.corrupt = 0
        self.skipped = 0
        self._held = b""
        self._silent = False

    def give_up_waiting(self) -> list[Frame]:
        """To be called once a cycle: a frame of which nothing more came since the last call is none.

        Returns:
            frames that stood behind it.
        """
        silent, self._silent = self._silent, True
        if not (silent and len(self._held) > 1):
            return []
        self._reject()
        return self._found()

    def feed(self, data: bytes) -> list[Frame]:
        """Takes bytes; the frames that are whole now."""
        self._held += data
        self._silent &= not data
        return self._found()

    def _found(self) -> list[Frame]:
        frames: list[Frame] = []
        while True:
            at = self._held.find(SYNC)
            if at < 0:
                # the last byte may be the first of a sync
                keep = 1 if self._held.endswith(SYNC[:1]) else 0
                self._skip(len(self._held) - keep)
                return frames
            self._skip(at)
            frame, whole = self._first()
            if not whole:
                return frames
            if frame is not None:
                frames.append(frame)

    def _skip(self, count: int) -> None:
        self.skipped += count
        self._held = self._held[count:]

    def _first(self) -> tuple[Frame | None, bool]:
        """The frame that begins here, if it is one, and whether all of it is there to tell."""
        held = self._held
        if len(held) < HEADER_BYTES:
            return None, False
        version, kind, length, sequence, stamp_ns = _HEADER.unpack_from(held, len(SYNC))
        if version != VERSION or kind not in PAYLOADS or length > LONGEST:
            return self._reject()
        end = HEADER_BYTES + length
        if len(held) < end + CRC_BYTES:
            return None, False
        (crc,) = struct.unpack_from("<I", held, end)
        if crc != zlib.crc32(held[len(SYNC) : end]):
            return self._reject()
        try:
            values = parse_payload(kind, held[HEADER_BYTES:end])
        except FrameError:
            return self._reject()
        self._held = held[end + CRC_BYTES :]
        return Frame(kind, sequence, stamp_ns, values), True

    def _reject(self) -> tuple[None, bool]:
        # a sync may stand inside of what was taken for a frame: only the sync itself is passed over
        self.corrupt += 1
        self._skip(len(SYNC))
        return None, True


def command_of(frame: Frame, wheels: int, rods: int) -> Command:
    """The command in a frame.

    Raises:
        FrameError: it is of other wheels or rods, or holds numbers that nothing can be commanded.
    """
    values = frame.values
    for name, expected in (("wheels", wheels), ("rods", rods)):
        if values[name] != expected:
            raise FrameError(f"command for {values[name]} {name} given, expected {expected}")
    command = Command(*(values[name] for name in Command._fields))
    for name in ("torque", "dipole", "sun"):
        if not all(map(math.isfinite, getattr(command, name))):
            raise FrameError(f"command with a {name} that is no number")
    return command
