# SPDX-License-Identifier: Apache-2.0
"""The component that the control node hosts: messages in, messages out, without a running graph."""

import numpy as np
import pytest
from okeefe_spacecraft import okeefe_values
from sensor_msgs.msg import MagneticField

from css_common.codec import codec_of
from css_msgs.msg import ControlStatus, SunEstimate, WheelState
from sunpoint_control.modes import MODE_SAFE, MODE_SUN_ACQUISITION, REASON_COMMANDED
from sunpoint_control.nodes.mrp_control import MrpControl


def values_of(**changes):
    return okeefe_values(MrpControl.table(), **changes)


def build(**changes):
    values = values_of(**changes)
    assert list(MrpControl.conflicts(values)) == []
    return MrpControl("mrp_control", values)


def received(stamp_ns, field=None):
    sun = codec_of(SunEstimate).sample(
        stamp_ns,
        "bus",
        sun_b=np.array([0.6, 0.0, 0.8]),
        omega_bn_b=np.array([0.01, 0.0, 0.0]),
        validity=SunEstimate.VALIDITY_VALID,
        rate_source=SunEstimate.RATE_GYRO,
    )
    wheels = codec_of(WheelState).sample(stamp_ns, "bus", speed=np.array([100.0, -50.0, 0.0, 30.0]), torque=np.zeros(4))
    inputs = {"sun": sun, "wheels": wheels}
    if field is not None:
        inputs["field"] = field
    return inputs


def field_at(stamp_ns, off=False):
    covariance = np.zeros(9)
    covariance[0] = -1.0 if off else 1e-14
    return codec_of(MagneticField).sample(
        stamp_ns, "bus", magnetic_field=np.array([1e-5, 2e-5, -3e-5]), magnetic_field_covariance=covariance
    )


def cycle(control, step, field=None):
    stamp_ns = control.epoch_ns + step * control.period_ns
    return control.cycle(stamp_ns, received(stamp_ns, field))


@pytest.mark.parametrize("rods", [False, True])
def test_messages_fit_their_types(rods):
    control = build(rods__fitted=rods)
    outgoing = cycle(control, 0)
    declared = {o.key: o for o in MrpControl.outputs("x", control.values)}
    assert set(outgoing) == set(declared) == ({"wheels", "status", "rods"} if rods else {"wheels", "status"})
    for key, sample in outgoing.items():
        codec = codec_of(declared[key].message_type)
        again = codec.decode(codec.encode(sample))
        for field in codec.fields:
            np.testing.assert_array_equal(getattr(again, field.name), getattr(sample, field.name))


def test_listens_to_the_chosen_estimator():
    inputs = {i.key: i for i in MrpControl.inputs("x", values_of(graph__estimator="wavg", rods__fitted=True))}
    assert inputs["sun"].topic == "wavg/sun_estimate"
    assert inputs["wheels"].lengths == {"speed": 4}
    assert (inputs["field"].topic, inputs["field"].required) == ("mag/field", False)
    assert "field" not in {i.key for i in MrpControl.inputs("x", values_of())}


def test_mode_numbers_are_those_of_the_message():
    from sunpoint_control import modes

    for name in dir(ControlStatus):
        if name.startswith(("MODE_", "REASON_")):
            assert getattr(modes, name) == getattr(ControlStatus, name), name


def test_status_says_what_is_done():
    status = cycle(build(), 0)["status"]
    assert status.mode == MODE_SUN_ACQUISITION
    assert status.pointing_error == pytest.approx(np.arccos(0.8))
    assert status.rate == pytest.approx(0.01)
    assert np.any(status.torque_b) and np.any(status.wheel_momentum_b)


def test_idle_keeps_the_actuators_at_rest():
    control = build(rods__fitted=True, dumping__enabled=True)
    cycle(control, 0, field_at(control.epoch_ns))
    stamp_ns = control.epoch_ns + control.period_ns
    outgoing = control.idle(stamp_ns, received(stamp_ns))
    assert not np.any(outgoing["wheels"].torque) and not np.any(outgoing["rods"].dipole)
    assert (outgoing["status"].mode, outgoing["status"].reason) == (MODE_SAFE, REASON_COMMANDED)
    assert outgoing["wheels"].stamp_ns == stamp_ns


def test_field_is_held_until_the_next_is_due():
    control = build(rods__fitted=True, dumping__enabled=True, magnetometer__divider=5)
    dumping = [cycle(control, k, field_at(control.epoch_ns) if k == 0 else None)["status"].dumping for k in range(8)]
    assert dumping == [1, 1, 1, 1, 1, 0, 0, 0]


def test_a_magnetometer_that_says_off_is_not_used():
    control = build(rods__fitted=True, dumping__enabled=True)
    assert cycle(control, 0, field_at(control.epoch_ns, off=True))["status"].dumping == 0


def test_gains_change_in_flight():
    control = build()
    before = cycle(control, 0)["status"].torque_b
    control.tune(values_of(gains__k=0.296))
    after = cycle(control, 1)["status"].torque_b
    assert after[1] > 1.9 * before[1]


@pytest.mark.parametrize(
    ("changes", "parameter"),
    [
        ({"wheels_out": [4]}, "wheels_out"),
        ({"dumping__enabled": True}, "dumping.enabled"),
        ({"modes__point_angle_deg": 40.0}, "modes.point_angle_deg"),
    ],
)
def test_conflicts_are_named(changes, parameter):
    assert any(message.startswith(parameter) for message in MrpControl.conflicts(values_of(**changes)))
