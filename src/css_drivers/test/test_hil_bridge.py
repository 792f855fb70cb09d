# SPDX-License-Identifier: Apache-2.0
"""The bridge as a component: what a board is told of each message, and what is commanded with its answer or without."""

import numpy as np
import pytest
from sensor_msgs.msg import Imu, MagneticField

from css_common.codec import codec_of
from css_common.schema import default_values
from css_drivers.hil_frame import (
    HAS_FIELD,
    HAS_GYRO,
    HAS_SUN,
    HAS_WHEELS,
    Command,
    FrameReader,
    command_frame,
)
from css_drivers.hil_link import HilLink
from css_drivers.nodes.hil_bridge import HilBridge
from css_msgs.msg import CssVoltages, SunEstimate, WheelState

FITTED = {
    "cells__normals": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
    "wheels__axes": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
    "wheels__inertia": 0.001,
    "wheels__max_torque": 0.01,
    "wheels__max_speed_rpm": 6000.0,
    "rods__fitted": True,
    "rods__max_dipole": 0.2,
    "board_estimates": True,
    "answer_within": 0.05,
}
NOTHING = np.array([-1.0] + [0.0] * 8)


class Board(HilLink):
    """Answers with `command` while there is one, and keeps what it is told."""

    name = "board"

    def __init__(self):
        self.command, self.told, self._waiting = None, [], b""

    def send(self, data):
        (frame,) = FrameReader().feed(data)
        self.told.append(frame)
        if self.command is not None:
            self._waiting = command_frame(frame.sequence, frame.stamp_ns, self.command)

    def receive(self, seconds):
        data, self._waiting = self._waiting, b""
        return data

    def close(self):
        self.command = None


@pytest.fixture
def bridge():
    """The bridge of three wheels and three rods, and its board."""

    def build(**changes):
        board = Board()
        HilBridge.opened = board
        return HilBridge("hil_bridge", default_values(HilBridge.table(), **FITTED | changes)), board

    yield build
    HilBridge.opened = None


def received(**others):
    cells = codec_of(CssVoltages).sample(0, "bus", voltages=np.array([0.5, np.nan]))
    return {"cells": cells, "gyro": None, "field": None, "wheels": None, **others}


def imu(covariance=0.0):
    given = {"angular_velocity": np.array([0.1, -0.2, 0.3])}
    return codec_of(Imu).sample(0, "bus", angular_velocity_covariance=NOTHING * -covariance, **given)


def field(covariance=0.0):
    given = {"magnetic_field": np.array([1e-5, -2e-5, 3e-5])}
    return codec_of(MagneticField).sample(0, "bus", magnetic_field_covariance=NOTHING * -covariance, **given)


def test_board_is_told_what_was_measured_and_what_was_not(bridge):
    component, board = bridge()
    wheels = codec_of(WheelState).sample(0, "bus", speed=np.array([10.0, -20.0, 30.0]))
    component.cycle(5, received())
    component.cycle(6, received(gyro=imu(), field=field(), wheels=wheels))
    component.cycle(7, received(gyro=imu(-1.0), field=field(-1.0)))
    first, second, third = (frame.values for frame in board.told)
    assert [frame.stamp_ns for frame in board.told] == [5, 6, 7]
    assert [frame.sequence for frame in board.told] == [0, 1, 2]
    assert first["flags"] == third["flags"] == 0
    assert first["gyro"] == third["gyro"] == third["field"] == (0.0, 0.0, 0.0)
    assert second["flags"] == HAS_GYRO | HAS_FIELD | HAS_WHEELS
    np.testing.assert_allclose(second["gyro"], [0.1, -0.2, 0.3], rtol=1e-6)
    np.testing.assert_allclose(second["field"], [1e-5, -2e-5, 3e-5], rtol=1e-6)
    assert second["wheel_speed"] == (10.0, -20.0, 30.0)
    assert second["cell"][0] == 0.5
    assert np.isnan(second["cell"][1])
    assert (second["rods"], second["period"]) == (3, 100_000)


COMMAND = Command(HAS_SUN, (0.0, 0.0, 1.0), (0.01, -0.005, 0.02), (0.1, -0.2, 0.3))


def test_command_is_published_with_what_is_beyond_limits(bridge):
    component, board = bridge()
    board.command = COMMAND
    messages = component.cycle(0, received())
    np.testing.assert_allclose(messages["wheels"].torque, COMMAND.torque, rtol=1e-6)
    np.testing.assert_allclose(messages["rods"].dipole, COMMAND.dipole, rtol=1e-6)
    assert messages["wheels"].saturated == messages["rods"].saturated == 0b100
    assert messages["estimate"].validity == SunEstimate.VALIDITY_VALID
    assert messages["estimate"].sun_b.tolist() == [0.0, 0.0, 1.0]


@pytest.mark.parametrize(("flags", "sun"), [(0, (0.0, 0.0, 1.0)), (HAS_SUN, (0.0, 0.0, 0.0))])
def test_direction_that_is_none_is_no_estimate(bridge, flags, sun):
    component, board = bridge()
    board.command = COMMAND._replace(flags=flags, sun=sun)
    estimate = component.cycle(0, received())["estimate"]
    assert estimate.validity == SunEstimate.VALIDITY_NONE
    assert not np.any(estimate.sun_b)


@pytest.mark.parametrize("hold", [0, 2])
def test_without_an_answer_actuators_rest_after_as_many_cycles_as_asked_for(bridge, hold):
    component, board = bridge(hold_cycles=hold)
    board.command = COMMAND
    assert component.cycle(0, received())["wheels"].torque[0] != 0.0
    board.command = None
    turning = []
    for k in range(4):
        messages = component.cycle(1 + k, received())
        turning.append(bool(np.any(messages["wheels"].torque)))
        assert turning[-1] == np.any(messages["rods"].dipole)
        assert messages["estimate"].validity == SunEstimate.VALIDITY_NONE
    assert turning == [k < hold for k in range(4)]
    assert "no answer of the board in 4 cycles" in component.standing().warning
    board.command = COMMAND
    assert np.any(component.cycle(9, received())["wheels"].torque)
    assert component.standing().figures["frames_lost"] == 4


def test_deactivated_it_rests_and_asks_nobody(bridge):
    component, board = bridge()
    board.command = COMMAND
    messages = component.idle(0, received())
    assert not np.any(messages["wheels"].torque)
    assert not np.any(messages["rods"].dipole)
    assert board.told == []


def test_line_that_is_too_slow_for_a_cycle_is_refused(bridge):
    values = default_values(HilBridge.table(), **FITTED | {"serial__baud": 9600})
    (reason,) = HilBridge.conflicts(values)
    # 52 and 40 bytes of payload, 22 around each, ten bits a byte: 1360 bits
    assert "take 0.1417 s" in reason
    assert "at least" in reason
    fast = int(reason.rpartition(" ")[2])
    enough = default_values(HilBridge.table(), **FITTED | {"serial__baud": fast})
    assert list(HilBridge.conflicts(enough)) == []
