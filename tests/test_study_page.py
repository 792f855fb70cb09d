# SPDX-License-Identifier: Apache-2.0
"""The page of a study: its numbers are the study's, and the command of a worst case flies that case."""

import json
import shlex

import numpy as np
import pyarrow.parquet as pq
import pytest
from page_reader import read
from synthetic_study import case_table, percentile_table

from css_analysis.configured_mission import configured
from css_analysis.study_record import CASES, MANIFEST, PERCENTILES, read_record
from css_bringup.commands import fly
from css_bringup.mission_asked_for import mission_of
from css_common.mission import load_mission
from css_report.commands.report import main
from css_report.html_page import html_of
from css_report.study_commands import MISSION_FILE, worst_cases, worst_rows
from css_report.study_page import study_page


class Configuration:
    """What the made-up tables take for one."""

    def __init__(self, estimator, gyro, overrides=()):
        self.estimator, self.gyro, self.overrides = estimator, gyro, overrides

    @property
    def labels(self):
        return {"estimator": self.estimator, "gyro": self.gyro, "overrides": " ".join(self.overrides)}


CONFIGURATIONS = [
    Configuration("ekf", True),
    Configuration("wavg", False, ("css_array.scale_cell_error=0.1",)),
]
TIME = np.arange(0.0, 900.0, 10.0)


def study(folder, *overrides, cases=30, values=None):
    """A study in a folder; case 7 of the first configuration took longest."""
    mission = load_mission("okeefe_2013", ["mission.case=0", *overrides])
    longest = np.linspace(10.0, 20.0, cases)
    longest[7] = 99.0
    columns = {"converging_s": longest.tolist(), "acquired_s": [None, *np.linspace(5.0, 9.0, cases - 1).tolist()]}
    folder.mkdir()
    manifest = {
        "format": 1,
        "mission": mission.name,
        "mission_text": mission.text(),
        "first_case": 0,
        "cases": cases,
        "steps": 9000,
        "configurations": [c.labels for c in CONFIGURATIONS],
        "versions": {"numpy": "1"},
    }
    (folder / MANIFEST).write_text(json.dumps(manifest))
    pq.write_table(case_table(CONFIGURATIONS, cases, values or {CONFIGURATIONS[0]: columns}), folder / CASES)
    pq.write_table(percentile_table(CONFIGURATIONS, TIME), folder / PERCENTILES)
    return read_record(folder)


@pytest.fixture(scope="module")
def made_up(tmp_path_factory):
    return study(tmp_path_factory.mktemp("studies") / "one")


@pytest.fixture(scope="module")
def page(made_up):
    return read(html_of(study_page(made_up)))


def test_bands_are_the_percentiles(page):
    assert page.plots["heading-error-deg"]["x"]["range"] == [0.0, TIME[-1] / 60.0]
    median = page.trace("heading-error-deg", "ekf (gyro): median")
    assert median["y"] == pytest.approx(0.9 * np.exp(-TIME / 600.0), rel=1e-6)
    low, high = page.traces("heading-error-deg", "ekf (gyro): 5 to 95 %")
    assert low["y"] == pytest.approx(0.1 * np.exp(-TIME / 600.0), rel=1e-6)
    assert high["y"] == pytest.approx(2.0 * np.exp(-TIME / 600.0), rel=1e-6) and high["fill"] == "tonexty"


def test_histograms_count_every_case_once(page):
    bars = page.trace("cases-converging-s", "ekf (gyro)")
    assert sum(bars["y"]) == pytest.approx(100.0)
    last = bars["y"][-1]
    assert last == pytest.approx(100.0 / 30.0)
    # Clopper & Pearson, 1 of 30
    assert last + bars["error_y"]["array"][-1] == pytest.approx(17.22, abs=0.01)
    assert last - bars["error_y"]["arrayminus"][-1] == pytest.approx(0.084, abs=0.001)
    patterns = [trace["marker"]["pattern"]["shape"] for trace in page.plots["cases-converging-s"]["traces"]]
    assert len(set(patterns)) == len(patterns)


def test_cases_without_a_value_are_said(page):
    assert any("ekf (gyro): 1 of 30 cases have no value" in text for text in page.texts)
    assert any(text.startswith("96.7% (82.8% to 99.9%)") for text in page.texts)


def test_the_worst_come_first():
    values = np.array([1.0, np.nan, 3.0, 3.0])
    assert worst_rows(values, higher_is_better=False).tolist() == [1, 2, 3, 0]
    assert worst_rows(values, higher_is_better=True).tolist() == [1, 0, 2, 3]
    assert worst_rows(np.ones(3), higher_is_better=False).tolist() == []


@pytest.mark.parametrize("overrides", [(), ("mission.seed=9", "mission.duration=900")])
def test_a_command_flies_the_case_of_the_study(tmp_path, overrides):
    made_up = study(tmp_path / "study", *overrides)
    page = read(html_of(study_page(made_up)))
    commands = [text for text in page.texts if text.startswith("./sunpoint fly ")]
    reference = "okeefe_2013" if not overrides else str(tmp_path / "study" / MISSION_FILE)
    found = {(w.configuration, w.quantity): w for w in reversed(list(worst_cases(made_up, reference)))}
    slowest = found["ekf (gyro)", "converging_s"]
    assert slowest.case == 7 and slowest.value == 99.0 and slowest.command in commands
    assert found["ekf (gyro)", "acquired_s"].case == 0 and found["ekf (gyro)", "acquired_s"].value is None
    flown = load_mission("okeefe_2013", [*overrides])
    for worst, configuration in (
        (slowest, CONFIGURATIONS[0]),
        (found["wavg (no gyro) css_array.scale_cell_error=0.1", "converging_s"], CONFIGURATIONS[1]),
    ):
        asked = fly._parser().parse_args(shlex.split(worst.command)[2:])
        expected = configured(flown, estimator=configuration.estimator, gyro=configuration.gyro)
        expected = expected.with_overrides([*configuration.overrides, f"mission.case={worst.case}"])
        assert mission_of(asked).text() == expected.text()
    assert (tmp_path / "study" / MISSION_FILE).is_file() == bool(overrides)


def test_two_studies_stand_side_by_side(made_up, tmp_path, capsys):
    other = study(tmp_path / "two", cases=12)
    file = tmp_path / "both.html"
    assert main([str(made_up.folder), "--against", str(other.folder), "-o", str(file), "--json"]) == 0
    page = read(file.read_text(encoding="utf-8"))
    assert {"heading-error-deg", "heading-error-deg-2", "cases-converging-s-2"} <= set(page.plots)
    told = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert told["sections"] == ["summary", "percentiles-against-time", "cases", "worst-cases", "mission-and-versions"]


def test_the_same_study_gives_the_same_page(made_up):
    assert html_of(study_page(made_up)) == html_of(study_page(read_record(made_up.folder)))
