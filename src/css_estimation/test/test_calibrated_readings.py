# SPDX-License-Identifier: Apache-2.0
"""Readings less what a calibration found: closed forms, and an estimator that is given one or the other."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import Imu, MagneticField, Temperature

from css_common.codec import Sample, codec_of
from css_common.component import Cycles
from css_common.message_columns import Columns
from css_common.mission import MissionError, load_mission
from css_common.schema import default_values
from css_common.shared_sections import section_table
from css_environment.mission_environment import MissionEnvironment
from css_estimation.nodes.attitude_filter import AttitudeFilter
from css_estimation.nodes.ekf import Ekf
from css_estimation.nodes.triad import Triad
from css_msgs.msg import CssVoltages
from css_sensors.calibrated_readings import CalibratedReadings, is_calibrated

TABLE = tuple(p for section in ("cells", "gyro", "magnetometer") for p in section_table(section))
TWO = {"cells__normals": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]}


def imu(rate_b, *, off=False, stamp_ns=0):
    covariance = np.array([-1.0 if off else 0.0] + [0.0] * 8)
    return codec_of(Imu).sample(stamp_ns, "bus", angular_velocity=rate_b, angular_velocity_covariance=covariance)


def field(field_b, *, off=False, stamp_ns=0):
    covariance = np.array([-1.0 if off else 0.0] + [0.0] * 8)
    return codec_of(MagneticField).sample(stamp_ns, "bus", magnetic_field=field_b, magnetic_field_covariance=covariance)


def temperature(degrees, stamp_ns=0):
    return codec_of(Temperature).sample(stamp_ns, "bus", temperature=degrees)


def test_each_correction_takes_its_error_off():
    matrix = np.array([[1.1, 0.01, 0.0], [0.01, 0.9, 0.02], [0.0, 0.02, 1.0]])
    values = default_values(
        TABLE, **TWO, cells__measured__scales=[0.5, 2.0], cells__measured__darks=[0.1, -0.1],
        gyro__measured__bias_deg_h=[3600.0, 0.0, -7200.0], magnetometer__measured__bias_nt=[100.0, 0.0, -50.0],
        magnetometer__measured__matrix=matrix.ravel().tolist(),
    )  # fmt: skip
    readings = CalibratedReadings(values)
    assert readings.cells(np.array([0.35, 0.9])) == pytest.approx([0.5, 0.5])
    assert readings.rate(imu(np.zeros(3)))[0] == pytest.approx(np.radians([-1.0, 0.0, 2.0]))
    true = np.array([2e-5, -1e-5, 3e-5])
    read = matrix @ true + 1e-9 * np.array([100.0, 0.0, -50.0])
    assert readings.field(field(read))[0] == pytest.approx(true, rel=1e-12)
    assert readings.fields(np.tile(read, (3, 1))) == pytest.approx(np.tile(true, (3, 1)), rel=1e-12)
    assert is_calibrated(values)


def test_without_a_calibration_readings_are_what_they_were():
    values = default_values(TABLE, **TWO)
    readings, voltages, read = CalibratedReadings(values), np.array([0.1, 0.2]), np.array([0.1, 0.2, 0.3])
    assert readings.cells(voltages) is voltages
    assert readings.rate(imu(read)) == readings.field(field(read)) == ((0.1, 0.2, 0.3), True)
    assert not is_calibrated(values)


def test_a_sensor_that_is_off_or_silent_measures_nothing():
    readings = CalibratedReadings(default_values(TABLE, **TWO))
    for nothing in (readings.rate(None), readings.field(None)):
        assert nothing == ((0.0, 0.0, 0.0), False)
    assert readings.rate(imu(np.ones(3), off=True)) == ((0.0, 0.0, 0.0), False)
    assert readings.field(field(np.ones(3), off=True)) == ((0.0, 0.0, 0.0), False)


def test_scales_go_with_the_temperature_and_what_had_none_is_said():
    given = {"cells__measured__scales": [0.5, 2.0], "cells__measured__darks": [0.1, 0.0]}
    coefficients = {"cells__measured__temperature_coefficients": [0.002, -0.01], "cells__measured__temperature": 20.0}
    readings = CalibratedReadings(default_values(TABLE, **TWO, **given, **coefficients))
    outputs = np.array([0.3, 1.5])
    read = outputs * np.array([0.5, 2.0]) * (1.0 + np.array([0.002, -0.01]) * 15.0) + np.array([0.1, 0.0])
    assert readings.cells(read, temperature(35.0)) == pytest.approx(outputs, rel=1e-12)
    assert readings.warning == ""
    assert readings.cells(read) == pytest.approx(CalibratedReadings(default_values(TABLE, **TWO, **given)).cells(read))
    assert "no temperature (css/temperature) was heard in 1 of 2 cycles" in readings.warning
    assert "scales are those at 20 deg C" in readings.warning


COEFFICIENTS = [
    "cells.measured.temperature_coefficients=" + ",".join(["0.004", "-0.003"] * 4),
    "cells.measured.temperature=20.0",
]


@pytest.mark.parametrize("kind", [Ekf, AttitudeFilter, Triad])
def test_who_hears_cells_hears_their_temperature_when_it_matters(kind):
    mission = load_mission("okeefe_2013", COEFFICIENTS)
    values = mission.node_of(kind, "it").values
    (heard,) = (i for i in kind.inputs("it", values) if i.key == "temperature")
    assert heard.topic == "css/temperature" and not heard.required and heard.held_s > 0.0
    (finding,) = kind.preflight(mission.node_of(kind, "it"), {node.name: node for node in mission.nodes})
    assert "no node of the mission publishes css/temperature" in finding.text and not finding.refused
    plain = load_mission("okeefe_2013").node_of(kind, "it")
    assert not any(i.key == "temperature" for i in kind.inputs("it", plain.values))
    assert not list(kind.preflight(plain, {}))


def headings_at(degrees, voltages, overrides):
    """Estimates of a Kalman filter whose cells have a temperature."""
    node = load_mission("okeefe_2013", ["ekf.health.enabled=false", *overrides]).node("ekf")
    component = node.component("ekf", node.values)
    told = []
    for k, outputs in enumerate(voltages):
        stamp_ns = component.epoch_ns + k * component.period_ns
        cells = codec_of(CssVoltages).sample(stamp_ns, "bus", voltages=outputs)
        heard = None if degrees is None else temperature(degrees, stamp_ns)
        estimate = component.cycle(stamp_ns, {"cells": cells, "gyro": None, "temperature": heard})["estimate"]
        assert isinstance(estimate, Sample)
        told.append(estimate.sun_b)
    return np.array(told), component.standing().warning


def test_an_estimator_that_hears_the_temperature_is_one_with_cells_of_no_coefficient():
    true = np.random.default_rng(2).uniform(0.0, 1.0, (20, 8))
    read = true * (1.0 + np.array([0.004, -0.003] * 4) * 30.0)
    expected, _ = headings_at(None, true, [])
    found, warning = headings_at(50.0, read, COEFFICIENTS)
    assert found == pytest.approx(expected, abs=1e-9) and warning == ""
    deaf, warning = headings_at(None, read, COEFFICIENTS)
    assert np.abs(deaf - expected).max() > 1e-3
    assert "was heard at any time, where scales are those at 20 deg C" in warning


FIELD_ERRORS = [
    "magnetometer.measured.bias_nt=2000.0,-3000.0,1000.0",
    "magnetometer.measured.matrix=1.1,0.02,0.0,0.02,0.9,0.01,0.0,0.01,1.05",
]
CELL_ERRORS = [
    "cells.measured.scales=" + ",".join(["1.2", "0.8"] * 4),
    "cells.measured.darks=" + ",".join(["0.02", "-0.01"] * 4),
]


@pytest.mark.parametrize("kind", [AttitudeFilter, Triad])
def test_an_attitude_is_that_of_the_corrected_field_and_cells(kind):
    """The same attitude from true readings, and from those with the errors that a calibration knows."""
    told = []
    for overrides in ([], [*FIELD_ERRORS, *CELL_ERRORS]):
        component = kind("it", load_mission("okeefe_2013", overrides).node_of(kind, "it").values)
        at = MissionEnvironment(component.values, field=True).at(0.0)
        turn, _ = Rotation.align_vectors([[0.1, -0.2, 0.97]], [at.sun_n])
        outputs = np.maximum(component.values.cells.normals @ turn.apply(at.sun_n), 0.0)
        read, field_b = outputs, turn.apply(at.field_n)
        if overrides:
            read = outputs * np.array([1.2, 0.8] * 4) + np.array([0.02, -0.01] * 4)
            matrix = np.array([[1.1, 0.02, 0.0], [0.02, 0.9, 0.01], [0.0, 0.01, 1.05]])
            field_b = matrix @ field_b + 1e-9 * np.array([2000.0, -3000.0, 1000.0])
        for k in range(3):
            stamp_ns = component.epoch_ns + k * component.period_ns
            cells = codec_of(CssVoltages).sample(stamp_ns, "bus", voltages=read)
            gyro = imu(np.zeros(3), stamp_ns=stamp_ns)
            received = {"cells": cells, "gyro": gyro, "field": field(field_b, stamp_ns=stamp_ns)}
            given = component.cycle(stamp_ns, received)["attitude"]
        told.append(given)
    assert told[0].validity != 0
    assert told[1].q_bn == pytest.approx(told[0].q_bn, abs=1e-6)


def estimates(overrides, voltages, rates):
    node = load_mission("okeefe_2013", ["ekf.health.enabled=false", *overrides])
    entry = node.node("ekf")
    component = entry.component("ekf", entry.values)
    stamps = node.epoch_ns + node.period_ns * np.arange(len(voltages))
    rows = np.arange(len(voltages))
    gyro = Columns(stamps, angular_velocity=rates, angular_velocity_covariance=np.zeros((len(rows), 9)))
    columns = {"cells": Columns(stamps, voltages=voltages), "gyro": gyro}
    out = component.cycle_through(Cycles(stamps, columns, {"cells": rows, "gyro": rows}))
    assert out is not None
    return out["estimate"].sun_b


def test_an_estimator_with_a_calibration_is_one_with_the_corrected_readings():
    rng = np.random.default_rng(1)
    true = rng.uniform(0.0, 1.0, (50, 8))
    scales, darks = rng.uniform(0.8, 1.2, 8), rng.uniform(-0.02, 0.02, 8)
    rates = rng.normal(0.0, 0.01, (50, 3))
    bias = np.array([100.0, -50.0, 20.0])
    given = [
        f"cells.measured.scales={','.join(map(repr, scales.tolist()))}",
        f"cells.measured.darks={','.join(map(repr, darks.tolist()))}",
        f"gyro.measured.bias_deg_h={','.join(map(repr, bias.tolist()))}",
    ]
    corrected = estimates([], (true * scales + darks - darks) / scales, rates)
    read = estimates(given, true * scales + darks, rates + np.radians(bias) / 3600.0)
    assert read == pytest.approx(corrected, abs=1e-9)
    assert np.abs(estimates([], true * scales + darks, rates) - corrected).max() > 1e-3


@pytest.mark.parametrize(
    ("override", "told"),
    [
        ("cells.measured.scales=1,1", "2 given, expected one for each of the 8 cells"),
        ("cells.measured.normals=1,0,0", "1 given, expected one for each of the 8 cells"),
        ("magnetometer.measured.bias_nt=1,2,3,4,5,6", "6 numbers given, expected three"),
        ("magnetometer.measured.matrix=1,0,0,0,1,0,0,0,0", "singular"),
        ("gyro.measured.bias_deg_h=1,2,3,4,5,6", "6 numbers given, expected three"),
    ],
)
def test_what_is_no_calibration_is_refused(override, told):
    with pytest.raises(MissionError, match=told):
        load_mission("okeefe_2013", [override])


def test_two_calibrations_of_one_thing_are_refused():
    ones = ",".join(["1.0"] * 8)
    with pytest.raises(MissionError, match="expected one of the two"):
        load_mission("okeefe_sun_filter", [f"cells.measured.scales={ones}", f"sun_filter.calibration.gains={ones}"])
