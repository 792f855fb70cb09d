# SPDX-License-Identifier: Apache-2.0
"""The table of a study lists the faults of each case, those that its flight by itself tells."""

import numpy as np
import pytest

from css_analysis.fault_record import fault_texts
from css_common.mission import load_mission, mission_from_text
from css_monte_carlo.direct_flight import fly_directly
from css_monte_carlo.drawn_faults import fault_column, has_faults
from css_monte_carlo.study import Configuration, run_study

TEXT = """
/**:
  ros__parameters:
    extends: okeefe_2013
    mission: {duration: 10.0}
    faults:
      some_wheel: {time: 1.0, within: 5.0, target: wheel.any, kind: dead, probability: 0.5}
      board: {time: 2.0, end: 3.0, target: cell.4-7, kind: stuck_random, lowest: 0.1, highest: 0.9, probability: 0.7}
      gyro: {time: 4.0, target: gyro.any, kind: bias, offset: 0.2}
      later: {time: 50.0, target: gyro.x, kind: dead}
css_array: {ros__parameters: {random_faults: {count: 2, kind: mixed, time: 5.0}}}
"""
CASES = 12


@pytest.fixture(scope="module")
def mission():
    return mission_from_text(TEXT, "drawn.yaml")


def test_each_case_has_the_faults_that_its_flight_tells(mission):
    column = fault_column(mission, np.arange(CASES)).to_pylist()
    wheels = [line.partition(" ")[0] for lines in column for line in lines if line.startswith("wheel.")]
    assert 0 < len(wheels) < CASES and len(set(wheels)) > 1
    assert len({line for lines in column for line in lines if line.startswith("gyro.")}) == 3
    for case, lines in enumerate(column):
        flown = fly_directly(mission.with_overrides([f"mission.case={case}"]))
        assert sorted(lines) == sorted(fault_texts(flown.faults))


def test_a_study_keeps_them_whichever_way_it_flies(mission, tmp_path):
    configurations = [Configuration("ekf", True), Configuration("wavg", False, ("faults.gyro.offset=0.3",))]
    table = run_study(mission, configurations, CASES, tmp_path / "study").cases
    for part, expected in zip(configurations, (mission, part_of(mission, 0.3)), strict=True):
        rows = table.filter(np.array([name == part.estimator for name in table["estimator"].to_pylist()]))
        assert rows["faults"].to_pylist() == fault_column(expected, np.arange(CASES)).to_pylist()
    stepped = mission.with_overrides(["mission.duration=6", "lockstep.wait_for=css/voltages"])
    again = run_study(stepped, configurations[:1], 2, tmp_path / "again").cases
    assert again["faults"].to_pylist() == fault_column(stepped, np.arange(2)).to_pylist()


def part_of(mission, offset):
    return mission.with_overrides([f"faults.gyro.offset={offset}"])


def test_a_study_without_faults_has_no_such_column(tmp_path):
    plain = load_mission("okeefe_2013", ["mission.duration=2"])
    assert not has_faults(plain)
    assert "faults" not in run_study(plain, [Configuration("ekf", True)], 2, tmp_path / "study").cases.column_names
