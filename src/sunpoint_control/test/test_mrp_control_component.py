# SPDX-License-Identifier: Apache-2.0
"""The component that the control node hosts: messages in, messages out, without a running graph."""

import numpy as np
import pytest
from okeefe_spacecraft import okeefe_values
from sensor_msgs.msg import MagneticField

from css_common.codec import codec_of
from css_common.mission import load_mission
from css_msgs.msg import ControlStatus, Faults, Health, SunEstimate, WheelState
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
    assert (
        set(outgoing) == set(declared) - {"health"} == ({"wheels", "status", "rods"} if rods else {"wheels", "status"})
    )
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


def fly_with(control, steps, turn):
    """Messages of so many cycles with a body at rest 90 deg beside the Sun; `turn`: what wheels make of torques."""
    speed, told, statuses = np.zeros(4), [], []
    for step in range(steps):
        stamp_ns = control.epoch_ns + step * control.period_ns
        inputs = received(stamp_ns)
        inputs["sun"].sun_b, inputs["sun"].omega_bn_b = np.array([1.0, 0.0, 0.0]), np.zeros(3)
        inputs["sun"].rate_source = SunEstimate.RATE_SUN
        inputs["wheels"].speed = speed.copy()
        outgoing = control.cycle(stamp_ns, inputs)
        speed = speed + turn(outgoing["wheels"].torque) * 0.1 / 0.001
        statuses.append(outgoing["status"])
        if "health" in outgoing:
            told.append(outgoing["health"])
    return told, statuses


def test_what_is_held_for_failed_is_told_once_and_in_the_log():
    control = build()
    lines: list[str] = []
    control.report = lines.append
    told, statuses = fly_with(control, 25, lambda torque: torque * [0.0, 1.0, 1.0, 1.0])
    assert len(told) == 1
    (message,) = told
    assert (message.sort.tolist(), message.unit.tolist()) == ([Faults.SORT_WHEEL], [0])
    assert message.evidence.tolist() == [Health.EVIDENCE_RESPONSE]
    statistic, threshold, since_s = message.rows
    assert statistic > threshold and since_s == 0.0
    assert (statuses[0].wheels_isolated, statuses[-1].wheels_isolated) == (0, 1)
    assert len(lines) == 1
    assert lines[0].startswith("wheel.0 held for failed at ") and lines[0].endswith("; commanded nothing")
    # a node that was deactivated knows nothing of before
    stamp_ns = control.epoch_ns + 25 * control.period_ns
    assert control.idle(stamp_ns, {})["status"].wheels_isolated == 0
    again = control.cycle(stamp_ns + control.period_ns, received(stamp_ns + control.period_ns))
    assert again["health"].unit.tolist() == []
    assert lines[1].startswith("wheel.0 used again")


def test_without_a_fresh_estimate_actuators_rest_at_once_and_safe_mode_says_why():
    control = build(rods__fitted=True, dumping__enabled=True)
    cycle(control, 0, field_at(control.epoch_ns))
    for step in range(1, 4):
        stamp_ns = control.epoch_ns + step * control.period_ns
        silent = {**received(stamp_ns, field_at(stamp_ns)), "sun": None}
        outgoing = control.cycle(stamp_ns, silent)
        assert not np.any(outgoing["wheels"].torque)
    assert not np.any(outgoing["rods"].dipole)
    assert (outgoing["status"].mode, outgoing["status"].reason) == (MODE_SAFE, ControlStatus.REASON_STALE_INPUT)
    for step in range(4, 8):
        outgoing = cycle(control, step)
    assert outgoing["status"].mode == MODE_SUN_ACQUISITION and np.any(outgoing["wheels"].torque)


def test_the_estimate_may_fall_silent_in_real_time_alone_and_a_mission_must_have_it():
    (sun, *_) = MrpControl.inputs("x", values_of())
    assert sun.key == "sun" and sun.required and sun.outlived


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ([], False),
        (["mrp_control.health.rate_cutoff=0.0"], True),
        (["ekf.rate.cutoff=0.2"], True),
        (["ekf.rate.cutoff=0.2", "mrp_control.health.rate_cutoff=0.2"], False),
        (["mrp_control.health.rate_cutoff=0.0", "mrp_control.health.enabled=false"], False),
        (["mrp_control.health.rate_cutoff=0.0", "ekf.use_gyro=false"], False),
    ],
)
def test_a_low_pass_that_health_does_not_reckon_with_is_found_before_the_flight(changes, found):
    graph = {node.name: node for node in load_mission("okeefe_2013", changes).nodes}
    findings = [finding.text for finding in MrpControl.preflight(graph["mrp_control"], graph)]
    assert any(text.startswith("health.rate_cutoff: ") for text in findings) == found
