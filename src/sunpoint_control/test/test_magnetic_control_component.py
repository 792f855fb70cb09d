# SPDX-License-Identifier: Apache-2.0
"""The component of the control with torque rods alone: messages in, messages out, checks before a flight."""

import math

import numpy as np
import pytest
from cubesat import MISSION, control_values
from sensor_msgs.msg import MagneticField

from css_common.codec import codec_of
from css_common.mission import MissionError, find_mission, load_mission, mission_from_text
from css_common.preflight import preflight
from css_msgs.msg import SunEstimate
from sunpoint_control.modes import MODE_DETUMBLE, MODE_SAFE, MODE_SUN_ACQUISITION
from sunpoint_control.nodes.magnetic_control import MagneticControl


def build(*overrides):
    values = control_values(*overrides)
    assert list(MagneticControl.conflicts(values)) == []
    return MagneticControl("magnetic_control", values)


def field_at(stamp_ns, turned):
    field = 3e-5 * np.array([math.cos(turned), math.sin(turned), -0.5])
    return codec_of(MagneticField).sample(
        stamp_ns, "bus", magnetic_field=field, magnetic_field_covariance=np.full(9, 1e-14)
    )


def cycles(control, first, count, turn=0.0, sun=True, every=4, reads=None):
    """Status and dipole of so many cycles, with a field that turns by an angle from one measurement to the next.

    `reads` is what the magnetometer makes of a field.
    """
    out = []
    for k in range(first, first + count):
        stamp_ns = control.epoch_ns + k * control.period_ns
        estimate = codec_of(SunEstimate).sample(
            stamp_ns, "bus", sun_b=np.array([0.6, 0.0, 0.8]), validity=SunEstimate.VALIDITY_VALID
        )
        field = field_at(stamp_ns, turn * k / every) if k % every == 0 else None
        if field is not None and reads is not None:
            field.magnetic_field = reads(field.magnetic_field)
        outgoing = control.cycle(stamp_ns, {"sun": estimate if sun else None, "field": field})
        out.append((outgoing["status"], outgoing["rods"].dipole.copy()))
    return out


def test_it_needs_neither_wheels_nor_gyro_nor_a_sun_estimate():
    values = control_values()
    inputs = {i.key: i for i in MagneticControl.inputs("x", values)}
    assert set(inputs) == {"sun", "field"}
    assert not any(i.required for i in inputs.values())
    assert inputs["sun"].topic == "wls/sun_estimate"
    assert inputs["field"].divider == 4
    assert {o.topic for o in MagneticControl.outputs("x", values)} == {"control/status", "rods/dipole_command"}


def test_messages_fit_their_types():
    control = build()
    declared = {o.key: o for o in MagneticControl.outputs("x", control.values)}
    stamp_ns = control.epoch_ns
    for outgoing in (control.cycle(stamp_ns, {"sun": None, "field": None}), control.idle(stamp_ns, {})):
        assert set(outgoing) == set(declared)
        for key, sample in outgoing.items():
            codec = codec_of(declared[key].message_type)
            again = codec.decode(codec.encode(sample))
            for field in codec.fields:
                np.testing.assert_array_equal(getattr(again, field.name), getattr(sample, field.name))


def test_it_acquires_and_detumbles():
    slow = cycles(build(), 0, 9)[-1]
    assert slow[0].mode == MODE_SUN_ACQUISITION
    assert slow[0].pointing_error == pytest.approx(math.acos(0.6))
    assert np.any(slow[1])
    fast = cycles(build(), 0, 13, turn=0.3)[-1]
    assert fast[0].mode == MODE_DETUMBLE
    assert np.any(fast[1])


def test_it_hears_the_field_that_a_calibration_of_the_magnetometer_tells():
    errors = (
        "magnetometer.measured.bias_nt=2000.0,-3000.0,1000.0",
        "magnetometer.measured.matrix=1.1,0.02,0.0,0.02,0.9,0.01,0.0,0.01,1.05",
    )
    matrix = np.array([[1.1, 0.02, 0.0], [0.02, 0.9, 0.01], [0.0, 0.01, 1.05]])

    def wrong(field_b):
        return matrix @ field_b + 1e-9 * np.array([2000.0, -3000.0, 1000.0])

    plain, misled, corrected = (
        cycles(build(*overrides), 0, 9, turn=0.05, reads=reads)[-1][1]
        for overrides, reads in (((), None), ((), wrong), (errors, wrong))
    )
    assert corrected == pytest.approx(plain, rel=1e-9)
    assert np.abs(misled - plain).max() > 0.01 * np.abs(plain).max()


def test_without_an_estimate_a_fast_body_is_damped_all_the_same():
    with_sun, without = (cycles(build(), 0, 13, turn=0.3, sun=sun)[-1][1] for sun in (True, False))
    np.testing.assert_array_equal(with_sun, without)


def test_a_field_that_stops_coming_is_held_until_the_next_is_due():
    control = build("rest_before_measurement=false")
    cycles(control, 0, 9)
    silent = [np.any(dipole) for _, dipole in cycles(control, 9, 8, every=1000)]
    assert silent == [True] * 3 + [False] * 5


def test_idle_keeps_the_rods_at_rest():
    control = build()
    cycles(control, 0, 9)
    outgoing = control.idle(control.epoch_ns + 9 * control.period_ns, {})
    assert not np.any(outgoing["rods"].dipole)
    assert outgoing["status"].mode == MODE_SAFE


def test_gains_change_in_flight():
    control, other = build(), build()
    cycles(control, 0, 8)
    cycles(other, 0, 8)
    other.tune(control_values("gains.spin=1e-5"))
    first, second = (np.linalg.norm(cycles(c, 8, 1)[0][1]) for c in (control, other))
    assert second < 0.1 * first


@pytest.mark.parametrize(
    ("override", "says"),
    [
        ("rods.fitted=false", "rods.fitted: false"),
        ("magnetometer.divider=1", "rest_before_measurement: true, but magnetometer.divider is 1"),
        ("magnetic_control.modes.detumble_exit_rate_deg_s=20.0", "modes.detumble_exit_rate_deg_s: above"),
    ],
)
def test_conflicts_are_refused(override, says):
    with pytest.raises(MissionError, match=says):
        load_mission(MISSION, [override])


@pytest.mark.parametrize(
    ("override", "says"),
    [
        ("rods.max_dipole=0.0", "rods.max_dipole: 0 given"),
        ("magnetometer.divider=40", "magnetometer.divider: a measurement every 10 s, in which the body"),
        ("magnetometer.divider=24", "field.longest_gap: 5 given, but the field is measured every 6 s"),
        ("magnetic_control.gains.spin=0.01", "gains: 0.01 N m s held for 1 s takes 1 of the body rate"),
        ("spacecraft.array_normal=0.0,0.0,1.0", "spacecraft.array_normal: 90 deg from the axis of the largest"),
        ("spacecraft.inertia=0.035,0.0,0.0,0.0,0.034,0.0,0.0,0.0,0.01", "spacecraft.inertia: the largest moment"),
    ],
)  # fmt: skip
def test_what_is_doubtful_is_said_before_the_flight(override, says):
    warnings = preflight(load_mission(MISSION, [override]))
    assert any(says in line for line in warnings), warnings


def test_a_mission_without_magnetometer_is_told_that_its_rods_will_rest():
    text = find_mission(MISSION).read_text(encoding="utf-8").replace("css_sim/magnetometer, ", "")
    text = text.replace("magnetometer:\n  ros__parameters:\n    bias_nt: 500.0\n    noise_nt: 100.0\n", "")
    warnings = preflight(mission_from_text(text, "made up"))
    assert any("no node of graph.nodes publishes mag/field" in line for line in warnings)


ALONE = """
/**:
  ros__parameters:
    mission: {duration: 30.0, period: 0.25, epoch: "2026-06-01T00:00:00Z"}
    orbit: {source: elements, altitude: 500.0e+3, inclination_deg: 97.4}
    spacecraft: {inertia: [0.039, 0.0, 0.0, 0.0, 0.034, 0.0, 0.0, 0.0, 0.010], array_normal: [1.0, 0.0, 0.0]}
    wheels: {fitted: false}
    rods: {fitted: true, max_dipole: 0.2}
    magnetometer: {divider: DIVIDER}
    graph: {nodes: [css_sim/dynamics, css_sim/magnetometer, sunpoint_control/magnetic_control]}
magnetic_control:
  ros__parameters: {law: detumble}
"""


def test_without_an_estimator_the_field_must_pace_the_cycles():
    """Rods and magnetometer alone are enough for detumbling."""
    assert preflight(mission_from_text(ALONE.replace("DIVIDER", "1"), "made up")) == []
    with pytest.raises(MissionError, match=r"magnetometer\.divider: 4 given, but nothing comes in the cycles"):
        preflight(mission_from_text(ALONE.replace("DIVIDER", "4"), "made up"))


def test_the_mission_as_it_stands_is_not_doubtful():
    assert preflight(load_mission(MISSION)) == []
