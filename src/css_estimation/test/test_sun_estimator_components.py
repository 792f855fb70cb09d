# SPDX-License-Identifier: Apache-2.0
"""The components that the estimator nodes host: messages in, messages out, without a running graph."""

import numpy as np
import pytest
from listing import components, executable, settings_of
from okeefe_spacecraft import okeefe_values
from sensor_msgs.msg import Imu, MagneticField

from css_common.codec import codec_of
from css_estimation.sun.sun_estimator import SunEstimator
from css_estimation.sun.sun_heading import RATE_FIELD, RATE_GYRO, RATE_SUN
from css_msgs.msg import CssVoltages, SunEstimate

KINDS = pytest.mark.parametrize("kind", components(base=SunEstimator), ids=executable)
FIELD_KINDS = pytest.mark.parametrize(
    "kind",
    [kind for kind in components(base=SunEstimator) if any(p.name == "rate.use_field" for p in kind.parameters)],
    ids=executable,
)
SUN_B = np.array([0.2, -0.1, -0.9])
OMEGA = np.array([0.01, 0.0, -0.02])


def values_of(kind, **changes):
    return okeefe_values(kind.table(), **(settings_of(kind, "cells", "spacecraft") | changes))


def build(kind, **changes):
    return kind("sun", values_of(kind, **changes))


def light(component, share=1.0):
    """Outputs of a component's cells that see the Sun."""
    return share * np.maximum(component.values.cells.normals @ SUN_B, 0.0)


def cells(stamp_ns, voltages):
    return codec_of(CssVoltages).sample(stamp_ns, "bus", voltages=np.array(voltages, dtype=np.float64))


def imu(stamp_ns, off=False):
    covariance = np.zeros(9)
    covariance[0] = -1.0 if off else 1e-8
    return codec_of(Imu).sample(stamp_ns, "bus", angular_velocity=OMEGA.copy(), angular_velocity_covariance=covariance)


def field_of(stamp_ns, off=False):
    covariance = np.zeros(9)
    covariance[0] = -1.0 if off else 1e-15
    field_b = np.array([3e-5, -1e-5, 0.0])
    return codec_of(MagneticField).sample(stamp_ns, "bus", magnetic_field=field_b, magnetic_field_covariance=covariance)


def run(component, steps, start=0, off=False, share=1.0):
    estimates = []
    for k in range(start, start + steps):
        stamp_ns = component.epoch_ns + k * component.period_ns
        received = {"cells": cells(stamp_ns, light(component, share)), "gyro": imu(stamp_ns, off)}
        estimates.append(component.cycle(stamp_ns, received)["estimate"])
    return estimates


@KINDS
def test_message_fits_its_type(kind):
    codec = codec_of(SunEstimate)
    for estimate in run(build(kind), 3):
        again = codec.decode(codec.encode(estimate))
        for field in codec.fields:
            np.testing.assert_array_equal(getattr(again, field.name), getattr(estimate, field.name))
    assert estimate.frame_id == "bus"


@KINDS
def test_topics(kind):
    values = values_of(kind, cells__normals=[0.0, 0.0, 1.0])
    voltages, gyro, *_ = kind.inputs("left", values)
    assert (voltages.topic, voltages.lengths, voltages.required) == ("css/voltages", {"voltages": 1}, True)
    assert (gyro.topic, gyro.required) == ("gyro/imu", False)
    output, health = kind.outputs("left", values)
    assert output.topic == "left/sun_estimate"
    assert output.ends_cycle
    assert (health.topic, health.events) == ("health/left", True)
    assert kind.outputs("left", values_of(kind, cells__normals=[0.0, 0.0, 1.0], health__enabled=False)) == (output,)


@FIELD_KINDS
def test_the_field_is_an_input_when_it_may_be_used(kind):
    values = values_of(kind, rate__use_field=True, magnetometer__divider=5)
    *_, field = kind.inputs("sun", values)
    assert (field.topic, field.required, field.divider) == ("mag/field", False, 5)


@FIELD_KINDS
def test_a_magnetometer_that_says_off_and_a_silent_one_are_the_same(kind):
    off, silent, measuring = (build(kind, rate__use_field=True, use_gyro=False) for _ in range(3))
    for k in range(20):
        stamp_ns = off.epoch_ns + k * off.period_ns
        received = {"cells": cells(stamp_ns, light(off, 1.0 - 0.01 * k)), "gyro": None}
        a = off.cycle(stamp_ns, received | {"field": field_of(stamp_ns, off=True)})["estimate"]
        b = silent.cycle(stamp_ns, received | {"field": None})["estimate"]
        c = measuring.cycle(stamp_ns, received | {"field": field_of(stamp_ns)})["estimate"]
        assert codec_of(SunEstimate).encode(a) == codec_of(SunEstimate).encode(b)
    assert (a.rate_source, c.rate_source) == (RATE_SUN, RATE_FIELD)


@KINDS
def test_a_gyro_that_says_off_and_a_silent_one_are_the_same(kind):
    off, silent = build(kind), build(kind)
    for k in range(20):
        stamp_ns = off.epoch_ns + k * off.period_ns
        voltages = light(off, 1.0 - 0.01 * k)
        a = off.cycle(stamp_ns, {"cells": cells(stamp_ns, voltages), "gyro": imu(stamp_ns, off=True)})["estimate"]
        b = silent.cycle(stamp_ns, {"cells": cells(stamp_ns, voltages), "gyro": None})["estimate"]
        assert codec_of(SunEstimate).encode(a) == codec_of(SunEstimate).encode(b)
    assert a.rate_source == RATE_SUN


@KINDS
def test_a_covariance_that_is_not_estimated_says_so_and_nothing_else(kind):
    component = build(kind)
    estimates = [*run(component, 2, share=0.0), *run(component, 20, start=2)]
    assert estimates[0].validity == SunEstimate.VALIDITY_NONE
    for estimate in estimates:
        covariance = estimate.covariance.reshape(3, 3)
        if estimate.covariance[0] < 0.0 or estimate.validity == SunEstimate.VALIDITY_NONE:
            assert estimate.covariance.tolist() == [-1.0] + 8 * [0.0]
        else:
            np.testing.assert_array_equal(covariance, covariance.T)


@KINDS
def test_a_second_run_gives_the_same_bytes(kind):
    codec = codec_of(SunEstimate)
    first, second = run(build(kind), 50), run(build(kind), 50)
    assert [codec.encode(e) for e in first] == [codec.encode(e) for e in second]


@KINDS
def test_gyro_use_changes_in_flight_without_losing_the_state(kind):
    component = build(kind)
    before = run(component, 100)[-1]
    component.tune(values_of(kind, use_gyro=False))
    after = run(component, 1, start=100)[0]
    assert (before.rate_source, after.rate_source) == (RATE_GYRO, RATE_SUN)
    assert np.linalg.norm(after.omega_bn_b - before.omega_bn_b) < 0.07 * np.linalg.norm(OMEGA)
    np.testing.assert_allclose(after.sun_b, before.sun_b, atol=5e-3)


@KINDS
def test_age_follows_the_stamps(kind):
    component = build(kind)
    run(component, 5)
    late = run(component, 1, start=34, share=0.0)[0]
    assert late.age == pytest.approx(3.0)


@KINDS
@pytest.mark.parametrize(("source", "expected"), [("sensors", 0), ("model", 1), ("both", 0)])
def test_eclipse_by_the_orbit_model(kind, source, expected):
    """The default orbit starts under the Sun: 45 min later the model has it in shadow, while the cells say lit."""
    component = build(kind, eclipse__source=source)
    assert run(component, 1, start=600)[0].eclipse == 0
    assert run(component, 1, start=27_000)[0].eclipse == expected
