# SPDX-License-Identifier: Apache-2.0
"""The last lines of a flight say what was held for failed, and whether rightly."""

import json

import numpy as np
import pytest
from synthetic_flight import EPOCH_NS, estimates, stamps, tilted, truth

from css_analysis.faults_flown import faults_flown
from css_analysis.flight_log import read_flight
from css_bringup.flight_result import FlightResult
from css_bringup.verbs.fly import conclude
from css_common.codec import codec_of
from css_common.mission import load_mission
from css_msgs.msg import Faults, Health, SpacecraftState, SunEstimate
from css_recording.bag_metadata import Topic
from css_recording.bag_writer import BagWriter

STEPS = 200
CELL, STUCK = Faults.SORT_CELL, Faults.KIND_STUCK


def numbers(*values):
    return np.array(values, np.uint32)


def bag_of(folder, acting, held, with_truth=True, told_why=True):
    """A recording of 20 s: faults (cell, level) from 5 s on, cells held for failed from 8 s on."""
    pointing = np.full(STEPS, 10.0)
    said = estimates(tilted(pointing), isolated=np.where(np.arange(STEPS) >= 80, sum(1 << i for i in held), 0))
    series = {"/truth": (SpacecraftState, truth(pointing))} if with_truth else {}
    series["/ekf/sun_estimate"] = (SunEstimate, said)
    told = {
        "/faults/css_array": (
            Faults,
            5.0,
            dict(
                sort=numbers(*[CELL] * len(acting)),
                unit=numbers(*acting),
                kind=numbers(*[STUCK] * len(acting)),
                rows=np.array([(0.7, 0.0, 5.0, -1.0)] * len(acting)).ravel(),
            ),
        ),
        "/health/ekf": (
            Health,
            8.0,
            dict(
                sort=numbers(*[CELL] * len(held)),
                unit=numbers(*held),
                kind=numbers(*[STUCK] * len(held)),
                evidence=numbers(*[Health.EVIDENCE_STUCK] * len(held)),
                rows=np.array([(34.0, 20.0, 6.5)] * len(held)).ravel(),
            ),
        ),
    }
    if not told_why:
        del told["/health/ekf"]
    kinds = {name: kind for name, (kind, *_) in (series | told).items()}
    mission = load_mission("okeefe_2013", ["mission.duration=20"])
    with BagWriter(
        folder, [Topic(name, codec_of(kind).type_name) for name, kind in kinds.items()], {"mission": mission.text()}
    ) as writer:
        for step, stamp_ns in enumerate(stamps(STEPS).tolist()):
            for name, (kind, columns) in series.items():
                codec = codec_of(kind)
                row = {field.name: getattr(columns, field.name)[step] for field in codec.fields}
                writer.write(name, stamp_ns, codec.encode(codec.sample(stamp_ns, "bus", **row)))
            for name, (kind, time_s, fields) in told.items():
                if stamp_ns == EPOCH_NS + round(time_s * 1e9):
                    codec = codec_of(kind)
                    writer.write(name, stamp_ns, codec.encode(codec.sample(stamp_ns, "bus", **fields)))
    return folder


@pytest.fixture
def last_lines(tmp_path, capfd):
    def concluded(acting, held):
        bag = bag_of(tmp_path / "bag", acting, held)
        mission = load_mission("okeefe_2013", ["mission.duration=20"])
        conclude(mission, FlightResult(mission, simulated_s=20.0, steps=STEPS, bag=bag), as_json=True)
        said = capfd.readouterr()
        return said.out, said.err, json.loads(said.out.strip().splitlines()[-1])

    return concluded


EVIDENCE = "it reads the same while it should have changed (34, more than 20, from 6.5 s on); left out"


def test_a_detection_is_one_line_with_the_time_that_it_took(last_lines):
    out, err, told = last_lines([3], [3])
    assert f"detection: ekf: cell.3 stuck, at 8 s: {EVIDENCE}; it is stuck: detected after 3 s\n" in out
    assert "ekf left out cell 3 for failed" in out and "on which no fault acts" not in err
    (found,) = told["detections"]
    assert (found["target"], found["after_s"], found["false"], found["evidence"]) == (
        "cell.3",
        3.0,
        False,
        "it reads the same while it should have changed",
    )
    assert told["runs"][0]["isolated_cells"] == [3]


def test_a_false_isolation_is_a_warning_and_a_missed_fault_a_line(last_lines):
    out, err, told = last_lines([3], [5])
    assert f"detection: ekf: cell.5 stuck, at 8 s: {EVIDENCE}; false: no fault acts on it\n" in out
    assert "detection: cell.3 stuck, level 0.7, from 5 s on: not detected\n" in out
    warning = "ekf held cell.5 for failed at 8 s, on which no fault acts"
    assert f"warning: {warning}" in err and warning in told["warnings"]
    false, missed = told["detections"]
    assert false["false"] and not missed["false"] and missed["after_s"] is None and missed["target"] is None
    assert missed.keys() == false.keys() and missed["fault"] == "cell.3 stuck, level 0.7, from 5 s on"


def test_without_truth_nobody_says_that_it_is_false(tmp_path):
    bag = bag_of(tmp_path / "bag", [], [5], with_truth=False)
    flown = faults_flown(read_flight(bag), bag)
    assert [found.text() for found in flown.detections] == [f"ekf: cell.5 stuck, at 8 s: {EVIDENCE}"]
    assert flown.warnings == []


def test_what_is_left_out_without_a_reason_is_told_all_the_same(tmp_path):
    bag = bag_of(tmp_path / "bag", [3], [3], told_why=False)
    (found,) = faults_flown(read_flight(bag), bag).detections
    text = "ekf: cell.3 failed, at 8 s: nobody tells why; left out; it is stuck: detected after 3 s"
    assert found.text() == text
