# SPDX-License-Identifier: Apache-2.0
"""The page on what the Sun filter attains: what flies, and which numbers are asked of whom."""

import numpy as np
import pytest
from presence import present

from css_common.mission import load_mission
from css_papers.best import paper
from css_papers.best.calibration import calibrated_cells
from css_papers.best.layouts import layouts
from css_papers.best.scenarios import FILTER, Scenario, scenarios
from css_papers.papers import Request, find_paper

SHORT = {"mission.duration": "300"}


@pytest.mark.parametrize("scenario", scenarios(), ids=lambda scenario: scenario.label)
def test_every_scenario_is_a_mission(scenario):
    for gyro in scenario.gyros:
        mission = scenario.configuration(gyro).applied(load_mission(scenario.mission))
        assert mission.values.graph.estimator == scenario.estimator
        normals = np.asarray(mission.values.cells.normals).reshape(-1, 3)
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-9)


def test_layouts_reach_the_mission():
    for name, layout in layouts().items():
        mission = Scenario(name, layout.settings).configuration(True).applied(load_mission("okeefe_sun_filter"))
        np.testing.assert_array_equal(np.asarray(mission.values.cells.normals).reshape(-1, 3), layout.normals)
        assert mission.values.cells.field_of_view_deg == layout.field_of_view_deg


def test_the_calibration_says_what_it_told_at_the_end_of_its_manoeuvre():
    """Before the cells are calibrated nothing has been told, and everything has its name and its error bar."""
    mission = load_mission("okeefe_calibration")
    assert max(event.time for event in mission.events) == 1300.0
    report = calibrated_cells(mission.with_overrides(["mission.duration=40"]))
    assert len(report) == 3 * 8 + 4
    assert not any(row.observable for row in report)
    assert {row.prior for row in report if row.name.endswith("gain")} == {2.0}
    assert all(row.sigma == pytest.approx(row.prior) for row in report)


def test_a_short_flight_gives_a_page(tmp_path, monkeypatch):
    chosen = [Scenario("short", SHORT, 5.0), Scenario("the paper's", SHORT, estimator="ekf", mission="okeefe_2013")]
    monkeypatch.setattr(paper, "scenarios", lambda: chosen)
    rows = find_paper("best").reproduce(Request(tmp_path, 2, True))
    assert {row.variant for row in rows} == {"gyro", "no gyro"}
    assert all(row.quantity.startswith("short") for row in rows)
    by_name = {(row.quantity, row.variant): row for row in rows}
    assert by_name["short: Sun found", "gyro"].here == 1.0
    assert present(by_name["short: heading error", "no gyro"].here) < 5.0
    # no eclipse within five minutes: what was not measured does not meet what it must
    assert by_name["short: in eclipse", "gyro"].here is None and not by_name["short: in eclipse", "gyro"].ok
    text = (tmp_path / "README.md").read_text(encoding="utf-8")
    assert "the paper's, no gyro" in text and FILTER not in text
