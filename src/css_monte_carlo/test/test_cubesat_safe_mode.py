# SPDX-License-Identifier: Apache-2.0
"""From a tip-off to power with rods and cells alone, a few cases; and criteria that judge a study."""

import itertools
import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from css_analysis.flight_metrics import windows_of
from css_analysis.study_criteria import judge, refuse_unknown_criteria
from css_common.mission import MissionError, load_mission, mission_from_text
from css_monte_carlo.case_table import case_table
from css_monte_carlo.chunk import fly_cases
from css_monte_carlo.commands.monte_carlo import main
from css_monte_carlo.mission_flight import MissionFlight
from css_monte_carlo.study import Study

NAME = "cubesat_3u_safe"
CASES = np.arange(6)
# two orbits, at half the rate of the control cycle: the study of the mission flies it as it is
SHORT = ("mission.duration=11400", "mission.period=0.5", "magnetometer.divider=2")


@pytest.fixture(scope="module")
def flown():
    """Rows of the study's table, and the true rates and angles of every step."""
    mission = load_mission(NAME, SHORT)
    flight = MissionFlight(mission)
    tallies, trace, _ = fly_cases(flight, CASES, 20, traced=True)
    rows = case_table(CASES, tallies, mission.period_ns * 1e-9, windows_of(mission)).to_pylist()
    return mission, rows, trace


def test_every_case_detumbles_and_finds_the_sun(flown):
    _, rows, _ = flown
    for row in rows:
        assert row["detumbled_s"] < 5677.0
        assert row["power_positive_from_s"] < 11000.0


def test_the_body_ends_in_the_spin_that_is_asked_for(flown):
    mission, _, trace = flown
    rates = np.degrees(trace[:, -1, 3:6])
    wanted = mission.node("magnetic_control").values.spin.rate_deg_s
    np.testing.assert_allclose(rates[:, 0], wanted, atol=0.5)
    assert np.abs(rates[:, 1:]).max() < 0.5


def test_rods_stay_within_their_limit_and_rest_before_each_measurement(flown):
    mission, rows, trace = flown
    dipoles = trace[:, :, -3:]
    assert np.abs(dipoles).max() <= mission.values.rods.max_dipole * (1.0 + 1e-12)
    assert not np.any(dipoles[:, 1::2])
    means = np.mean(np.sum(np.abs(dipoles), axis=2), axis=1)
    np.testing.assert_allclose([row["rod_dipole_mean"] for row in rows], means)


def test_kinetic_energy_falls_while_it_detumbles(flown):
    """From tip-off to half of it the mean energy of a minute is less than that of the minute before."""
    mission, _, trace = flown
    inertia = np.diag(mission.values.spacecraft.inertia)
    for case in trace:
        energy = 0.5 * (case[:, 3:6] ** 2) @ inertia
        minutes = energy[: len(energy) // 120 * 120].reshape(-1, 120).mean(axis=1)
        fast = minutes > 0.25 * minutes[0]
        end = int(np.argmin(fast))
        assert end > 1
        assert np.all(np.diff(minutes[:end]) < 0.0)


def test_every_case_acquires_from_whichever_estimator_is_named():
    mission = load_mission(NAME, [*SHORT, "magnetic_control.rate_from=estimator", "wls.rate.use_field=true"])
    tallies, _, _ = fly_cases(MissionFlight(mission), CASES[:3], 20)
    rows = case_table(CASES[:3], tallies, mission.period_ns * 1e-9, windows_of(mission)).to_pylist()
    assert all(row["detumbled_s"] < 5677.0 and row["power_positive_from_s"] < 11000.0 for row in rows)


CRITERIA = "criteria: {detumbled_s: {max: 100.0}, power_positive_late: {min: 0.9}}"


def study_of(share, detumbled, late):
    text = (
        "/**: {ros__parameters: {extends: cubesat_3u_safe, "
        f"measures: {{required_share: {share}, detumbled_rate_deg_s: 4.0, late_time: 100.0}}, {CRITERIA}}}}}"
    )
    labels = {"estimator": "wls", "gyro": False, "overrides": ""}
    count = len(detumbled)
    table = pa.table(
        {name: pa.array([value] * count) for name, value in labels.items()}
        | {"case": pa.array(range(count), pa.uint32())}
        | {"power_positive_from_s": pa.array([0.0] * count)}
        | {"detumbled_s": pa.array(detumbled, pa.float64()), "power_positive_late": pa.array(late, pa.float64())}
    )
    mission = mission_from_text(text, "made up")
    return Study(Path(), {"mission_text": mission.text(), "configurations": [labels]}, table, None)


def test_limits_are_included_and_no_value_meets_nothing():
    (judged,) = judge(study_of(0.5, [100.0, 100.1, None, 50.0], [0.9, 0.95, 1.0, 0.89]))
    assert (judged.met, judged.required, judged.passed) == (1, 2, False)
    missed = {key.split(" ")[0]: cases for key, cases in judged.missed.items() if cases}
    assert missed == {"detumbled_s.max": [1, 2], "power_positive_late.min": [3]}
    assert judged.lines()[0] == "FAIL  1 of 4 cases meet the criteria, must be 2, 95 % interval 0.6% to 80.6%  (wls)"
    assert judge(study_of(0.25, [100.0, 100.1, None, 50.0], [0.9, 0.95, 1.0, 0.89]))[0].passed


def test_a_mission_that_does_not_ask_judges_no_study():
    assert judge(study_of(0.0, [1000.0], [0.0])) == []


def test_a_criterion_that_nothing_measures_is_refused_before_the_study():
    text = "/**: {ros__parameters: {extends: cubesat_3u_safe, criteria: {detumbled: {max: 1.0}}}}"
    with pytest.raises(MissionError, match=r"criteria\.detumbled: unknown; did you mean detumbled_s"):
        refuse_unknown_criteria(mission_from_text(text, "made up"))


@pytest.mark.parametrize(("limit", "code"), [(1e5, 0), (1.0, 1)])
def test_the_verdict_is_the_exit_code(limit, code, tmp_path, capsys):
    overrides = itertools.chain.from_iterable(("--set", override) for override in SHORT)
    file = tmp_path / "asked.yaml"
    file.write_text(
        "/**: {ros__parameters: {extends: cubesat_3u_safe, criteria: "
        f"{{detumbled_s: {{max: {limit}}}, power_positive_late: {{min: 0.5}}}}}}}}",
        encoding="utf-8",
    )
    assert main([str(file), *overrides, "--cases", "2", "--out", str(tmp_path / "out"), "--json"]) == code
    *lines, last = capsys.readouterr().out.splitlines()
    (criteria,) = json.loads(last)["criteria"]
    assert (criteria["required"], criteria["met"]) == (2, 2 - 2 * code)
    assert any(line.startswith("FAIL" if code else "PASS") for line in lines)
