# SPDX-License-Identifier: Apache-2.0
"""The components that the nodes host: truth and sensors stamp by stamp, without a running graph."""

import math

import numpy as np
import pytest
from okeefe_spacecraft import okeefe_values
from scipy.spatial.transform import Rotation

from css_common.attitude import mrp_to_dcm
from css_common.codec import codec_of
from css_common.component import Component, all_conflicts
from css_sim.flight_environment import flight_environment
from css_sim.nodes.css_array import CssArray
from css_sim.nodes.dynamics import Dynamics
from css_sim.nodes.gyro import Gyro
from css_sim.nodes.magnetometer import Magnetometer


def build(kind: type[Component], **changes):
    """A component with parameters by dotted name, `__` for the dot."""
    names = {p.name.replace(".", "__") for p in kind.table()}
    values = okeefe_values(kind.table(), **{name: value for name, value in changes.items() if name in names})
    assert list(kind.conflicts(values)) == []
    return kind(kind.__name__.lower(), values)


def truths(steps, **changes):
    """Truth messages of a free flight, with the plant."""
    plant = build(Dynamics, geomagnetic_field=False, **changes)
    outgoing = plant.begin()
    messages = [outgoing["truth"]]
    for _ in range(steps - 1):
        messages.append(plant.cycle(messages[-1].stamp_ns, {"wheels": None})["truth"])
    return messages


def outputs(component, messages, key):
    return [component.cycle(m.stamp_ns, {"truth": m})[key] for m in messages]


@pytest.mark.parametrize(("shadow", "field"), [("conical", True), ("cylindrical", False)])
def test_a_mission_has_the_shadow_and_the_field_that_it_asks_for(shadow, field):
    values = build(Dynamics, shadow=shadow, geomagnetic_field=field).values
    environment = flight_environment(values)
    states = [environment.at(float(t)) for t in np.arange(0.0, 5600.0, 1.0)]
    light = np.array([state.illumination for state in states])
    assert {0.0, 1.0} <= set(light) and np.any((light > 0.0) & (light < 1.0)) == (shadow == "conical")
    assert all(any(state.field_n) is field for state in states[::500])
    assert not any(flight_environment(values, field=False).at(0.0).field_n)


def test_flight_has_as_many_stamps_as_cycles():
    plant = build(Dynamics, mission__duration=1.0, geomagnetic_field=False)
    stamps = [plant.begin()["truth"].stamp_ns]
    while True:
        outgoing = plant.cycle(stamps[-1], {"wheels": None})
        if plant.finished:
            break
        stamps.append(outgoing["truth"].stamp_ns)
    assert stamps == [plant.epoch_ns + k * plant.period_ns for k in range(10)]


def test_wheel_command_acts_over_the_step_after_its_stamp():
    plant = build(Dynamics, geomagnetic_field=False, initial__rate="fixed")
    begun = plant.begin()
    assert np.all(begun["wheels"].torque == 0.0) and np.all(begun["wheels"].speed == 0.0)

    class Command:
        torque = np.array([0.02, -0.05, 0.0, 0.0])

    after = plant.cycle(plant.epoch_ns, {"wheels": Command})
    assert after["wheels"].torque.tolist() == [0.02, -0.03, 0.0, 0.0]
    assert after["wheels"].torque_limited == 0b10
    np.testing.assert_allclose(after["wheels"].speed, [2.0, -3.0, 0.0, 0.0], rtol=1e-3, atol=1e-3)
    lost = plant.cycle(plant.epoch_ns + plant.period_ns, {"wheels": None})
    assert np.all(lost["wheels"].torque == 0.0)


def test_pose_turns_body_components_into_inertial_ones():
    plant = build(Dynamics, publish_pose=True, geomagnetic_field=False)
    outgoing = plant.begin()
    pose = outgoing["pose"].pose
    truth = outgoing["truth"]
    np.testing.assert_array_equal(pose[:3], truth.r_n)
    turn = Rotation.from_quat(pose[3:]).as_matrix()
    np.testing.assert_allclose(turn, np.array(mrp_to_dcm(tuple(truth.sigma_bn))).T, atol=1e-15)


@pytest.mark.parametrize(
    ("kind", "key", "changes"),
    [
        (CssArray, "voltages", {"noise": 0.01, "degradation_mode": "per_cell", "misalignment_deg": 1.0}),
        (Gyro, "imu", {"bias_walk_deg_s": 0.001, "scale_error": 0.01}),
        (Magnetometer, "field", {"bias_nt": 100.0}),
    ],
)
def test_a_sensor_restarted_half_way_gives_the_same_bytes(kind, key, changes):
    messages = truths(40)
    whole = outputs(build(kind, **changes), messages, key)
    half = outputs(build(kind, **changes), messages[20:], key)
    codec = codec_of(kind.outputs("x", build(kind).values)[0].message_type)
    assert [codec.encode(s) for s in whole[20:]] == [codec.encode(s) for s in half]


@pytest.mark.parametrize("kind", [CssArray, Gyro, Magnetometer])
def test_cases_have_their_own_errors(kind):
    (truth,) = truths(1)
    changes = {"noise": 0.01, "bias_nt": 50.0}
    samples = [build(kind, mission__case=c, **changes).cycle(truth.stamp_ns, {"truth": truth}) for c in (0, 1)]
    first, second = (codec_of(o.message_type) for o in [kind.outputs("x", build(kind).values)[0]] * 2)
    (a,), (b,) = (s.values() for s in samples)
    assert first.encode(a) != second.encode(b)


def test_deactivated_gyro_says_that_it_has_no_estimate():
    gyro = build(Gyro)
    (truth,) = truths(1)
    imu = gyro.idle(truth.stamp_ns, {"truth": truth})["imu"]
    assert imu.stamp_ns == truth.stamp_ns
    assert imu.angular_velocity_covariance[0] == -1.0
    assert np.all(imu.angular_velocity == 0.0)
    working = gyro.cycle(truth.stamp_ns, {"truth": truth})["imu"]
    expected = math.radians(0.01) ** 2 + (math.radians(1.0) / 3600) ** 2
    np.testing.assert_allclose(working.angular_velocity_covariance.reshape(3, 3), expected * np.eye(3), rtol=1e-12)
    assert working.orientation_covariance[0] == working.linear_acceleration_covariance[0] == -1.0


def test_magnetometer_speaks_when_it_is_due():
    messages = truths(7)
    due = build(Magnetometer, magnetometer__divider=3)
    spoken = [bool(due.cycle(m.stamp_ns, {"truth": m})) for m in messages]
    assert spoken == [True, False, False, True, False, False, True]


def test_cells_see_nothing_in_eclipse_without_albedo_and_something_with_the_sun():
    (truth,) = truths(1)
    array = build(CssArray, albedo__enabled=False)
    assert np.any(array.cycle(truth.stamp_ns, {"truth": truth})["voltages"].voltages > 0.4)
    truth.illumination = 0.0
    assert np.all(array.cycle(truth.stamp_ns, {"truth": truth})["voltages"].voltages == 0.0)


def test_albedo_reaches_cells_that_face_the_sunlit_earth():
    messages = truths(1)
    with_albedo = outputs(build(CssArray, degradation=0.0, warp=False), messages, "voltages")[0].voltages
    without = outputs(build(CssArray, degradation=0.0, warp=False, albedo__enabled=False), messages, "voltages")
    difference = with_albedo - without[0].voltages
    assert np.all(difference >= 0.0)
    # the paper's Fig. 5: up to a quarter of the direct Sun in this orbit
    assert 0.02 < difference.max() < 0.3


def test_faults_can_be_set_in_flight():
    messages = truths(2)
    array = build(CssArray, degradation=0.0)
    array.cycle(messages[0].stamp_ns, {"truth": messages[0]})
    array.tune(okeefe_values(CssArray.table(), faults=["0 stuck 0.7", "3 dead"], degradation=0.0))
    voltages = array.cycle(messages[1].stamp_ns, {"truth": messages[1]})["voltages"].voltages
    assert voltages[0] == 0.7 and voltages[3] == 0.0


def test_drawn_failures_are_those_of_the_case_and_stay_when_faults_are_set_in_flight():
    messages = truths(2)
    random_faults = {"random_faults__count": 2, "random_faults__kind": "stuck", "random_faults__value": 0.33}
    failed = []
    for case in range(6):
        array = build(CssArray, mission__case=case, **random_faults)
        failed.append(outputs(array, messages[:1], "voltages")[0].voltages == 0.33)
        stuck = ["0 stuck 0.7", "1 stuck 0.7", "2 stuck 0.7"]
        array.tune(okeefe_values(CssArray.table(), mission__case=case, faults=stuck, **random_faults))
        voltages = outputs(array, messages[1:], "voltages")[0].voltages
        assert np.array_equal(voltages == 0.33, failed[-1])
        assert np.all(voltages[:3][~failed[-1][:3]] == 0.7)
    assert all(np.count_nonzero(cells) == 2 for cells in failed)
    assert len({tuple(cells) for cells in failed}) > 1


@pytest.mark.parametrize(
    ("kind", "given", "message"),
    [
        (CssArray, {"faults": ["9 dead"]}, "expected cell.0 to cell.7"),
        (CssArray, {"random_faults.count": 9}, "random_faults.count: 9 given, expected at most"),
        (CssArray, {"output_low": 1.0, "output_high": 0.5}, "output_low: 1"),
        (CssArray, {"collar.cells": [1]}, "collar.cells"),
        (CssArray, {"albedo.reflectivity": "file"}, "albedo.mean_file"),
        (Dynamics, {"disturbances.aerodynamic": True}, "without panels"),
        (Dynamics, {"initial.wheel_speed_rpm": [1.0, 2.0]}, "initial.wheel_speed_rpm: 2 values"),
        (Dynamics, {"initial.wheel_speed_rpm": [9000.0]}, "9000 given"),
    ],
)
def test_wrong_values_are_refused_with_their_name(kind, given, message):
    values = okeefe_values(kind.table(), **{name.replace(".", "__"): value for name, value in given.items()})
    assert any(message in conflict for conflict in all_conflicts(kind, values, "x"))
