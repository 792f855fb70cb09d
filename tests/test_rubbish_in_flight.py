# SPDX-License-Identifier: Apache-2.0
"""Rubbish on every topic while the graph flies: refused, counted, reported; the flight is the one without it."""

import os
import struct

import numpy as np
import pytest
from flights import fly_composed, messages_by_topic, short_mission

from css_bringup.composed import ComposedFlight
from css_common.codec import codec_of
from css_msgs.msg import CssVoltages, SunEstimate, WheelTorqueCommand


def _rubbish(mission, stamp_ns: int) -> dict[str, tuple[type, list[bytes]]]:
    voltages, command, estimate = codec_of(CssVoltages), codec_of(WheelTorqueCommand), codec_of(SunEstimate)
    ahead = stamp_ns + 10 * mission.period_ns
    good = np.full(8, 0.5)
    return {
        "css/voltages": (
            CssVoltages,
            [
                voltages.encode(voltages.sample(ahead, "bus", voltages=good[:7])),
                voltages.encode(voltages.sample(ahead, "bus", voltages=good * np.nan)),
                voltages.encode(voltages.sample(ahead, "bus", voltages=good * np.inf)),
                voltages.encode(voltages.sample(stamp_ns - 10 * mission.period_ns, "bus", voltages=good)),
                voltages.encode(voltages.sample(stamp_ns + 10**17, "bus", voltages=good)),
                voltages.encode(voltages.sample(ahead, "camera", voltages=good)),
                b"\x00\x01\x00\x00" + os.urandom(40),
                b"\x00\x01\x00\x00" + struct.pack("<iII", 1, 2, 0xFFFFFFF0),
            ],
        ),
        "wheels/torque_command": (
            WheelTorqueCommand,
            [
                command.encode(command.sample(ahead, "bus", torque=np.full(4, np.nan))),
                command.encode(command.sample(ahead, "bus", torque=np.ones(3))),
            ],
        ),
        "ekf/sun_estimate": (
            SunEstimate,
            [estimate.encode(estimate.sample(ahead, "bus", sun_b=np.array([np.nan, 0.0, 0.0])))],
        ),
    }


def _publisher(flight: ComposedFlight, topic: str):
    """The publisher of the node whose topic it is: what others send is not even looked at."""
    ports = flight.nodes[flight.mission.publishers[topic]].output_ports.values()
    return next(port.publisher for port in ports if port.topic == topic)


@pytest.mark.parametrize("rounds", [20])
def test_flight_with_rubbish_is_the_flight_without(tmp_path, rounds):
    mission = short_mission(60.0)
    fly_composed(mission, tmp_path / "clean")
    with ComposedFlight(mission, tmp_path / "dirty") as flight:
        done = [0]

        def disturb(seconds: float) -> None:
            if done[0] < rounds:
                done[0] += 1
                for topic, (_, messages) in _rubbish(mission, flight.plant.stamp_ns).items():
                    for data in messages:
                        _publisher(flight, topic).publish(data)

        result = flight.fly(disturb)
        assert result.failure == ""
        ekf = flight.nodes["ekf"].edges["cells"].rejected
        assert {"wrong_length", "not_finite", "stamp_back", "stamp_jump", "wrong_frame", "malformed"} <= set(ekf)
        assert any("ekf:" in note and "refused (wrong_length)" in note for note in result.notes)
    clean, dirty = messages_by_topic(tmp_path / "clean"), messages_by_topic(tmp_path / "dirty")
    assert dirty["/truth"] == clean["/truth"]
