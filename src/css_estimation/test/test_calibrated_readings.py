# SPDX-License-Identifier: Apache-2.0
"""Readings less what a calibration found: closed forms, and an estimator that is given one or the other."""

import numpy as np
import pytest

from css_common.component import Cycles
from css_common.message_columns import Columns
from css_common.mission import MissionError, load_mission
from css_common.schema import default_values
from css_common.shared_sections import section_table
from css_estimation.calibrated_readings import CalibratedReadings, is_calibrated

TABLE = tuple(p for section in ("cells", "gyro", "magnetometer") for p in section_table(section))
TWO = {"cells__normals": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]}


def test_each_correction_takes_its_error_off():
    matrix = np.array([[1.1, 0.01, 0.0], [0.01, 0.9, 0.02], [0.0, 0.02, 1.0]])
    values = default_values(
        TABLE, **TWO, cells__measured__scales=[0.5, 2.0], cells__measured__darks=[0.1, -0.1],
        gyro__measured__bias_deg_h=[3600.0, 0.0, -7200.0], magnetometer__measured__bias_nt=[100.0, 0.0, -50.0],
        magnetometer__measured__matrix=matrix.ravel().tolist(),
    )  # fmt: skip
    readings = CalibratedReadings(values)
    assert readings.cells(np.array([0.35, 0.9])) == pytest.approx([0.5, 0.5])
    assert readings.rate((0.0, 0.0, 0.0)) == pytest.approx(np.radians([-1.0, 0.0, 2.0]))
    true = np.array([2e-5, -1e-5, 3e-5])
    read = matrix @ true + 1e-9 * np.array([100.0, 0.0, -50.0])
    assert readings.field(tuple(read)) == pytest.approx(true, rel=1e-12)
    assert readings.fields(np.tile(read, (3, 1))) == pytest.approx(np.tile(true, (3, 1)), rel=1e-12)
    assert is_calibrated(values)


def test_without_a_calibration_readings_are_what_they_were():
    values = default_values(TABLE, **TWO)
    readings, voltages, rate = CalibratedReadings(values), np.array([0.1, 0.2]), (0.1, 0.2, 0.3)
    assert readings.cells(voltages) is voltages
    assert readings.rate(rate) is rate and readings.field(rate) is rate
    assert not is_calibrated(values)


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
