# SPDX-License-Identifier: Apache-2.0
"""The component that the attitude filter's node hosts: messages in, messages out, references of its own."""

import numpy as np
import pytest
from attitude_scene import FACES
from okeefe_spacecraft import okeefe_values
from sensor_msgs.msg import Imu, MagneticField

from css_common.codec import Sample, codec_of
from css_estimation.attitude.flight_references import FlightReferences
from css_estimation.nodes.attitude_filter import AttitudeFilter
from css_msgs.msg import AttitudeEstimate, CssVoltages

DCM = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])


def values_of(**changes):
    changes.setdefault("cells__normals", FACES.ravel().tolist())
    return okeefe_values(
        AttitudeFilter.table(), cells__field_of_view_deg=180.0, cells__clip_normal=[0.0, 0.0, 0.0], **changes
    )


@pytest.fixture(scope="module")
def references():
    return FlightReferences(values_of())


def received(component, stamp_ns, references, *, gyro=True, field=True):
    """What sensors without noise say at a fixed attitude."""
    r = references.at((stamp_ns - component.epoch_ns) * 1e-9)
    voltages = r.intensity * np.maximum(FACES @ (DCM @ r.sun_n), 0.0)
    off, on = np.array([-1.0] + [0.0] * 8), np.eye(3).ravel()
    return {
        "cells": codec_of(CssVoltages).sample(stamp_ns, "bus", voltages=voltages),
        "gyro": codec_of(Imu).sample(stamp_ns, "bus", angular_velocity_covariance=on if gyro else off),
        "field": codec_of(MagneticField).sample(
            stamp_ns,
            "bus",
            magnetic_field=DCM @ r.field_n if field else np.zeros(3),
            magnetic_field_covariance=on if field else off,
        ),
    }


def run(component, references, steps=20, **sensors):
    estimates = []
    for k in range(steps):
        stamp_ns = component.epoch_ns + k * component.period_ns
        estimates.append(component.cycle(stamp_ns, received(component, stamp_ns, references, **sensors))["attitude"])
    return estimates


@pytest.mark.parametrize("model", ["vector", "voltage"])
def test_it_finds_the_attitude_and_its_message_fits_the_type(model, references):
    codec = codec_of(AttitudeEstimate)
    for estimate in run(AttitudeFilter("left", values_of(sun_model=model)), references):
        data = codec.encode(estimate)
        # no padding inside: 16 bytes of header, 49 doubles, 12 bytes
        assert len(data) == 4 + 16 + 49 * 8 + 12
        again = codec.decode(data)
        for entry in codec.fields:
            np.testing.assert_array_equal(getattr(again, entry.name), getattr(estimate, entry.name))
    x, y, z, w = estimate.q_bn
    # A(q) of a scalar-last quaternion (Schaub & Junkins, Eq. 3.93 with the scalar moved)
    v = np.array([x, y, z])
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    np.testing.assert_allclose((w * w - v @ v) * np.eye(3) + 2.0 * np.outer(v, v) - 2.0 * w * skew, DCM, atol=2e-3)
    assert estimate.frame_id == "bus" and estimate.validity == AttitudeEstimate.VALIDITY_VALID
    used = AttitudeEstimate.USED_FIELD | AttitudeEstimate.USED_SUN | AttitudeEstimate.USED_GYRO
    assert estimate.used == used and estimate.nis_dof >= 4


def test_topics():
    values = values_of(magnetometer__divider=5)
    cells, gyro, field = AttitudeFilter.inputs("left", values)
    assert (cells.topic, cells.required, cells.lengths) == ("css/voltages", True, {"voltages": 6})
    assert (gyro.topic, gyro.required) == ("gyro/imu", False)
    assert (field.topic, field.required, field.divider) == ("mag/field", False, 5)
    output, told = AttitudeFilter.outputs("left", values)
    assert output.topic == "left/attitude" and output.ends_cycle
    assert (told.topic, told.events) == ("health/left", True)
    assert AttitudeFilter.outputs("left", values_of(magnetometer__divider=5, health__enabled=False)) == (output,)


@pytest.mark.parametrize("sensors", [{"gyro": False}, {"field": False}])
def test_a_sensor_that_says_off_is_the_same_as_a_silent_one(sensors, references):
    off, silent = (AttitudeFilter(name, values_of()) for name in ("off", "silent"))
    run(off, references), run(silent, references)
    uses = []
    for k in range(20, 30):
        stamp_ns = off.epoch_ns + k * off.period_ns
        inputs = received(off, stamp_ns, references, **sensors)
        a = off.cycle(stamp_ns, inputs)["attitude"]
        b = silent.cycle(stamp_ns, inputs | {name: None for name in sensors})["attitude"]
        assert isinstance(a, Sample) and isinstance(b, Sample)
        np.testing.assert_array_equal(a.q_bn, b.q_bn)
        np.testing.assert_array_equal(a.covariance, b.covariance)
        uses.append(a.used)
    lost = AttitudeEstimate.USED_GYRO if "gyro" in sensors else AttitudeEstimate.USED_FIELD
    assert not uses[-1] & lost


def test_a_cell_that_no_sun_explains_is_in_the_mask_of_what_is_left_out(references):
    component = AttitudeFilter("left", values_of())
    *_, healthy = run(component, references)
    assert not healthy.isolated
    for k in range(20, 200):
        stamp_ns = component.epoch_ns + k * component.period_ns
        inputs = received(component, stamp_ns, references)
        voltages = np.array(inputs["cells"].voltages)
        voltages[3] = 3.0
        inputs["cells"] = codec_of(CssVoltages).sample(stamp_ns, "bus", voltages=voltages)
        told = component.cycle(stamp_ns, inputs)["attitude"]
    assert isinstance(told, Sample)
    assert told.isolated == 1 << 3
    assert told.validity == AttitudeEstimate.VALIDITY_VALID


def test_without_a_field_it_says_that_it_knows_nothing(references):
    estimate = run(AttitudeFilter("left", values_of()), references, field=False)[-1]
    assert estimate.validity == AttitudeEstimate.VALIDITY_NONE
    assert estimate.covariance[0] == -1.0 and not estimate.q_bn.any()


def test_the_field_of_its_own_model_may_differ(references):
    exact = np.array(references.at(100.0).field_n)
    coarse = np.array(FlightReferences(values_of(reference__field_degree=6)).at(100.0).field_n)
    assert 1e-8 < np.linalg.norm(coarse - exact) < 2e-6
    offset = FlightReferences(values_of(reference__field_offset_nt=[100.0, 0.0, -50.0])).at(100.0).field_n
    np.testing.assert_allclose(offset - exact, [1e-7, 0.0, -5e-8], atol=1e-15)


def test_light_of_the_earth_is_predicted_unless_it_is_not_wanted(references):
    references.at(100.0)
    assert references.light.any()
    blind = FlightReferences(values_of(albedo__compensate=False))
    blind.at(100.0)
    assert not blind.light.any()


def test_a_vector_cannot_calibrate_cells():
    assert any("calibration.mode" in line for line in AttitudeFilter.conflicts(
        values_of(sun_model="vector", calibration__mode="estimate")
    ))  # fmt: skip
    assert not list(AttitudeFilter.conflicts(values_of(calibration__mode="estimate")))
