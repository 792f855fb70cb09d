# SPDX-License-Identifier: Apache-2.0
"""What nodes held for failed, of their messages, beside what did fail."""

import numpy as np
import pytest
from synthetic_flight import EPOCH_NS, columns, estimates, stamps, tilted, truth

from css_analysis.estimator_runs import estimator_runs
from css_analysis.fault_record import FaultRecord
from css_analysis.flight_figures import write_figures
from css_analysis.flight_log import FlightLog
from css_analysis.flight_summary import isolated_lines
from css_analysis.health_record import Detection, HealthRecord, detections, health_records
from css_analysis.unit_spells import Spell, has_spells, spells
from css_common.codec import codec_of
from css_msgs.msg import ControlStatus, Faults, Health, SunEstimate

CODEC = codec_of(Health)


def told(second, *verdicts):
    """A message of verdicts (sort, unit, kind, evidence, statistic, threshold, since)."""
    table = [np.array(column, np.uint32) for column in zip(*(v[:4] for v in verdicts), strict=True)] or [
        np.zeros(0, np.uint32)
    ] * 4
    rows = np.array([v[4:] for v in verdicts], float).ravel()
    names = ("sort", "unit", "kind", "evidence")
    fields = dict(zip(names, table, strict=True))
    sample = CODEC.sample(EPOCH_NS + round(second * 1e9), "bus", rows=rows, **fields)
    return CODEC.decode(CODEC.encode(sample))


STUCK = (Faults.SORT_CELL, 3, Faults.KIND_STUCK, Health.EVIDENCE_STUCK, 34.0, 20.0, 59.5)
DEAD = (Faults.SORT_CELL, 3, Faults.KIND_DEAD, Health.EVIDENCE_STUCK, 34.0, 20.0, 59.5)
WHEEL = (Faults.SORT_WHEEL, 1, Faults.KIND_DEAD, Health.EVIDENCE_RESPONSE, 9.0, 5.0, 70.0)
GYRO = (Faults.SORT_GYRO, 0, Health.KIND_UNKNOWN, Health.EVIDENCE_SUN, 9.0, 5.0, 70.0)


def test_a_unit_is_held_from_the_first_message_that_has_it_to_the_first_that_has_it_not():
    records = health_records("ekf", [told(61.0, STUCK), told(75.0, STUCK, WHEEL), told(90.0, WHEEL)], EPOCH_NS)
    cell, wheel = records
    assert (cell.node, cell.target, cell.kind, cell.begin_s, cell.end_s) == ("ekf", "cell.3", "stuck", 61.0, 90.0)
    assert (cell.statistic, cell.threshold, cell.shown_s) == (34.0, 20.0, 59.5)
    assert (wheel.target, wheel.begin_s, wheel.end_s) == ("wheel.1", 75.0, None)
    assert cell.text() == (
        "ekf: cell.3 stuck, at 61 s: it reads the same while it should have changed (34, more than 20, from 59.5 s "
        "on); left out, used again at 90 s"
    )
    assert wheel.text().endswith("; commanded nothing, the others do its part")


def test_the_last_name_counts_and_a_second_time_is_another_record():
    (record,) = health_records("ekf", [told(61.0, STUCK), told(62.0, DEAD)], EPOCH_NS)
    assert record.kind == "dead" and record.begin_s == 61.0
    twice = health_records("ekf", [told(61.0, STUCK), told(62.0), told(63.0, STUCK)], EPOCH_NS)
    assert [(r.begin_s, r.end_s) for r in twice] == [(61.0, 62.0), (63.0, None)]


def record(target, begin_s, end_s=None):
    return HealthRecord("ekf", target, "stuck", "it says so", 2.0, 1.0, begin_s, begin_s, end_s)


def fault(target, begin_s, end_s=None, kind="stuck", **values):
    return FaultRecord(target, kind, {name: (value, "-") for name, value in values.items()}, begin_s, end_s)


def test_a_detection_is_of_the_fault_that_acts_when_it_begins():
    stuck = fault("cell.3", 60.0)
    (found,) = detections([record("cell.3", 61.25)], [stuck])
    assert found.fault is stuck and found.after_s == 1.25 and not found.is_false
    assert found.text().endswith("; it is stuck: detected after 1.25 s")


@pytest.mark.parametrize("other", [fault("cell.4", 60.0), fault("cell.3", 62.0), fault("cell.3", 10.0, 60.0)])
def test_what_no_fault_acts_on_is_false(other):
    false, *_ = detections([record("cell.3", 61.0, 61.5)], [other])
    assert false.is_false and false.text().endswith("; false: no fault acts on it")
    unknown, *_ = detections([record("cell.3", 61.0, 61.5)], [other], truth_known=False)
    assert not unknown.is_false and unknown.after_s is None and "false" not in unknown.text()


def test_a_fault_that_nobody_holds_for_one_is_not_detected():
    missed = fault("cell.4", 60.0)
    *_, last = detections([record("cell.3", 61.0)], [fault("cell.3", 60.0), missed])
    assert last == Detection(None, missed)
    assert last.text() == "cell.4 stuck, from 60 s on: not detected"
    # one that was left out already when it failed is left out all the same
    assert len(detections([record("cell.4", 50.0)], [missed])) == 1
    assert len(detections([record("cell.4", 50.0, 55.0)], [missed])) == 2


def test_axes_belong_to_their_sensor_tachometers_to_their_wheel_and_swapped_cells_to_each_other():
    gyro = [HealthRecord("ekf", "gyro.x", "unknown", "", 2.0, 1.0, 5.0, 5.0, None)]
    assert detections(gyro, [fault("gyro.z", 4.0)])[0].after_s == 1.0
    assert detections([record("wheel.2", 5.0)], [fault("tachometer.2", 4.0)])[0].after_s == 1.0
    assert detections([record("wheel.2", 5.0)], [fault("tachometer.1", 4.0)])[0].is_false
    swapped = fault("cell.1", 4.0, kind="swapped", other=6.0)
    assert [detections([record(f"cell.{i}", 5.0)], [swapped])[0].is_false for i in (1, 6, 2)] == [False, False, True]


STEPS = 1000  # of 0.1 s


def isolating_log():
    masks = np.zeros(STEPS, np.uint32)
    masks[200:500] = 0b1000
    masks[400:] |= 0b1
    left = np.zeros(STEPS, np.uint8)
    left[900:] = SunEstimate.LEFT_FIELD
    wheels = np.zeros(STEPS, np.uint32)
    wheels[300:] = 0b10
    pointing = np.full(STEPS, 10.0)
    return FlightLog(
        "made up",
        truth=truth(pointing),
        estimates={"ekf": estimates(tilted(pointing), isolated=masks, sensors_left=left)},
        control=columns(ControlStatus, stamps(STEPS), wheels_isolated=wheels),
        faults=[fault("cell.3", 15.0, 45.0)],
    )


def test_figures_show_when_units_fail_and_when_they_are_held_for_failed(tmp_path):
    log = isolating_log()
    found = [spell._replace(begin_s=round(spell.begin_s, 6)) for spell in spells(log)]
    assert found == [
        Spell("cell.3", "", 15.0, 45.0),
        Spell("cell.0", "ekf", 40.0, None),
        Spell("cell.3", "ekf", 20.0, 50.0),
        Spell("magnetometer", "ekf", 90.0, None),
        Spell("wheel.1", "control", 30.0, None),
    ]
    assert "health.png" in [file.name for file in write_figures(log, tmp_path)]
    log.faults.clear()
    log.control = None
    log.estimates["ekf"].isolated[:] = 0
    log.estimates["ekf"].sensors_left[:] = 0
    assert not has_spells(log)


def test_a_run_names_the_cells_that_were_left_out():
    (run,) = estimator_runs(isolating_log())
    assert run["isolated_cells"] == [0, 3]
    assert isolated_lines([run]) == ["ekf left out cells 0, 3 for failed, for some time or all"]
    assert isolated_lines([run | {"isolated_cells": [2], "flown": True}]) == [
        "ekf (flown) left out cell 2 for failed, for some time or all"
    ]
