# SPDX-License-Identifier: Apache-2.0
"""Somebody's board in the place of the flight software."""

import math
import time
from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np
from sensor_msgs.msg import Imu

from css_common.actuator_sections import ROD_MAX_DIPOLE, WHEEL_MAX_TORQUE, needed_of_wheels, wheel_axes
from css_common.codec import Sample
from css_common.component import Component, Input, Outgoing, Output, Received, Standing
from css_common.mission_section import PERIOD
from css_common.readings import Readings
from css_common.run import node_main
from css_common.schema import Table, Values, flag, integer, real
from css_common.sensor_inputs import field_input
from css_drivers import hil_link
from css_drivers.hil_exchange import TROUBLES, Exchange
from css_drivers.hil_frame import (
    CRC_BYTES,
    HAS_FIELD,
    HAS_GYRO,
    HAS_SUN,
    HAS_WHEELS,
    HEADER_BYTES,
    KIND_COMMAND,
    KIND_SENSORS,
    MOST_UNITS,
    Command,
    Sensors,
    payload_bytes,
)
from css_drivers.hil_link import BITS_PER_BYTE, HilLink, open_link
from css_drivers.relay import NOTHING
from css_msgs.msg import CssVoltages, RodDipoleCommand, SunEstimate, WheelState, WheelTorqueCommand
from css_sensors.cells import LARGEST_READING, NORMALS, SMALLEST_READING

ANSWER_WITHIN = real(
    "answer_within", 0.8, "-", "share of the control cycle that the board has for its answer", low=0.01, high=0.95
)
HOLD_CYCLES = integer(
    "hold_cycles",
    0,
    "-",
    "so many cycles without an answer keep the last command; then actuators rest",
    low=0,
    high=1000,
)
BOARD_ESTIMATES = flag("board_estimates", False, "publish the board's direction to the Sun as an estimate")

_NONE3 = (0.0, 0.0, 0.0)


class HilBridge(Component):
    """Sends cells, gyro, field and wheel speeds of each cycle to a board, and publishes the command that it answers.

    Class attributes:
        opened: a link that somebody has opened already, which the first exchange takes over.
    """

    opened: ClassVar[HilLink | None] = None
    shared = ("cells", "wheels", "rods", "magnetometer")
    parameters: ClassVar[Table] = (*hil_link.PARAMETERS, ANSWER_WITHIN, HOLD_CYCLES, BOARD_ESTIMATES)
    rehearses = False
    _exchange: Exchange | None = None

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        cells = Input(
            "cells",
            "css/voltages",
            CssVoltages,
            lengths={"voltages": len(values[NORMALS])},
            readings={"voltages": Readings(values[SMALLEST_READING], values[LARGEST_READING])},
        )
        gyro = Input("gyro", "gyro/imu", Imu, required=False, used=("angular_velocity",))
        inputs = [cells, gyro, field_input(values)]
        if len(wheel_axes(values)):
            lengths = {"speed": len(values.wheels.axes)}
            inputs.append(Input("wheels", "wheels/state", WheelState, required=False, lengths=lengths, used=("speed",)))
        return tuple(inputs)

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        outputs = []
        if len(wheel_axes(values)):
            outputs.append(Output("wheels", "wheels/torque_command", WheelTorqueCommand, ends_cycle=True))
        if values.rods.fitted:
            outputs.append(Output("rods", "rods/dipole_command", RodDipoleCommand, ends_cycle=True))
        if values[BOARD_ESTIMATES]:
            outputs.append(Output("estimate", f"{name}/sun_estimate", SunEstimate, ends_cycle=True))
        return tuple(outputs)

    @classmethod
    def needed(cls, values: Values) -> tuple[str, ...]:
        return (NORMALS.name, *needed_of_wheels(values))

    @classmethod
    def conflicts(cls, values: Values) -> Iterable[str]:
        wheels, rods = actuators(values)
        if max(wheels, rods) > MOST_UNITS:
            yield f"wheels.axes, rods.axes: {max(wheels, rods)} given, a frame holds at most {MOST_UNITS}"
            return
        needed, there = _time_on_line(values), values[ANSWER_WITHIN] * values[PERIOD]
        if values[hil_link.LINK] == hil_link.SERIAL and needed > there:
            yield (
                f"serial.baud: {values[hil_link.BAUD]} given, with which both frames of a cycle take {needed:.4f} s of "
                f"the {there:.4f} s that answer_within leaves; expected at least "
                f"{math.ceil(values[hil_link.BAUD] * needed / there)}"
            )

    def configure(self) -> None:
        self.release()
        self._wheels, self._rods = actuators(self.values)
        self._exchange = Exchange(self._open_link, self._wheels, self._rods)
        self._sequence = 0
        self._rest = Command(0, _NONE3, (0.0,) * self._wheels, (0.0,) * self._rods)
        self._last, self._since_answer = self._rest, 0

    def _open_link(self) -> HilLink:
        link, HilBridge.opened = HilBridge.opened, None
        return link or open_link(self.values)

    def release(self) -> None:
        if self._exchange is not None:
            self._exchange.close()

    @property
    def silent_for(self) -> float:
        """Wall time [s] since the board was asked what it has not answered; 0 when it answers."""
        assert self._exchange is not None
        since = self._exchange.silent_since
        return 0.0 if since is None else time.monotonic() - since

    @property
    def trouble(self) -> str:
        """What the link said when it failed; empty while it is there."""
        assert self._exchange is not None
        return self._exchange.trouble

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        assert self._exchange is not None
        before = self._exchange.trouble
        within = self.values[ANSWER_WITHIN] * self.period_ns * 1e-9
        command = self._exchange.ask(self._sequence, stamp_ns, self._sensors(received), within)
        self._sequence = (self._sequence + 1) & 0xFFFFFFFF
        if self._exchange.trouble and self._exchange.trouble != before:
            self.report(f"link to the board: {self._exchange.trouble}; actuators at rest until it is back")
        return self._messages(stamp_ns, self._in_force(command), command)

    def idle(self, stamp_ns: int, received: Received) -> Outgoing:
        """Actuators at rest, so that the flight goes on."""
        return self._messages(stamp_ns, self._rest, None)

    def _in_force(self, command: Command | None) -> Command:
        """The command that actuators get: the board's, its last one for a while, or rest."""
        if command is not None:
            self._last, self._since_answer = command, 0
            return command
        self._since_answer += 1
        return self._last if self._since_answer <= self.values[HOLD_CYCLES] else self._rest

    def _sensors(self, received: Received) -> Sensors:
        cells, gyro, field = received["cells"], received.get("gyro"), received.get("field")
        assert cells is not None  # a required input
        wheels = received.get("wheels")
        rate = None if gyro is None or gyro.angular_velocity_covariance[0] == -1.0 else gyro.angular_velocity
        measured = None if field is None or field.magnetic_field_covariance[0] == -1.0 else field.magnetic_field
        flags = ((rate, HAS_GYRO), (measured, HAS_FIELD), (wheels, HAS_WHEELS))
        return Sensors(
            flags=sum(flag for given, flag in flags if given is not None),
            period=round(self.period_ns * 1e-3),
            gyro=_NONE3 if rate is None else _vector(rate),
            field=_NONE3 if measured is None else _vector(measured),
            cell=cells.voltages.tolist(),
            wheel_speed=(0.0,) * self._wheels if wheels is None else _vector(wheels.speed),
            rods=self._rods,
        )

    def _messages(self, stamp_ns: int, force: Command, answer: Command | None) -> dict[str, Sample]:
        messages: dict[str, Sample] = {}
        if "wheels" in self.frames:
            torque = np.array(force.torque)
            beyond = _beyond(torque, self.values[WHEEL_MAX_TORQUE])
            messages["wheels"] = self.message("wheels", stamp_ns, saturated=beyond, torque=torque)
        if "rods" in self.frames:
            dipole = np.array(force.dipole)
            beyond = _beyond(dipole, self.values[ROD_MAX_DIPOLE])
            messages["rods"] = self.message("rods", stamp_ns, saturated=beyond, dipole=dipole)
        if "estimate" in self.frames:
            messages["estimate"] = self.message("estimate", stamp_ns, **_estimate(answer))
        return messages

    def standing(self) -> Standing:
        """What became of the frames, and how long the board took."""
        assert self._exchange is not None
        exchange = self._exchange
        figures: dict[str, int | float] = {**exchange.counts, **exchange.round_trip.figures("round_trip")}
        if exchange.trouble:
            return Standing(f"link to the board: {exchange.trouble}", True, figures)
        if self._since_answer > 0:
            return Standing(f"no answer of the board in {self._since_answer} cycles", True, figures)
        troubles = [f"{exchange.counts[name]} {name}" for name in TROUBLES if exchange.counts[name]]
        return Standing(", ".join(troubles), False, figures)


def actuators(values: Values) -> tuple[int, int]:
    """Number of wheels and rods."""
    return len(wheel_axes(values)), len(values.rods.axes) if values.rods.fitted else 0


def _time_on_line(values: Values) -> float:
    """Time [s] that the frames of one cycle take on a serial line."""
    wheels, rods = actuators(values)
    counts = {"cells": len(values[NORMALS]), "wheels": wheels, "rods": rods}
    payload = payload_bytes(KIND_SENSORS, **counts) + payload_bytes(KIND_COMMAND, **counts)
    return (payload + 2 * (HEADER_BYTES + CRC_BYTES)) * BITS_PER_BYTE / values[hil_link.BAUD]


def _vector(array: np.ndarray) -> tuple[float, ...]:
    return tuple(array.tolist())


def _beyond(values: np.ndarray, limit: float) -> int:
    """Bit i: value i is beyond the limit."""
    over = np.abs(values) > limit * (1.0 + 1e-6)  # a limit that went through 32 bits is none the less kept
    return sum(1 << i for i in np.flatnonzero(over).tolist())


def _estimate(answer: Command | None) -> dict[str, Any]:
    """Fields of css_msgs/SunEstimate of the board's direction, if it tells one."""
    sun = np.zeros(3) if answer is None or not answer.flags & HAS_SUN else np.array(answer.sun)
    length = float(np.linalg.norm(sun))
    known = length > 0.5  # else no unit vector, however rounded
    return {
        "sun_b": sun / length if known else np.zeros(3),
        "covariance": NOTHING,
        "omega_bn_b": np.zeros(3),
        "age": 0.0,
        "nis": 0.0,
        "lit_mask": 0,
        "isolated": 0,
        "nis_dof": 0,
        "validity": SunEstimate.VALIDITY_VALID if known else SunEstimate.VALIDITY_NONE,
        "rate_source": SunEstimate.RATE_NONE,
        "eclipse": SunEstimate.ECLIPSE_SUNLIT,
        "mode": 0,
        "sensors_left": 0,
    }


main = node_main(HilBridge)
