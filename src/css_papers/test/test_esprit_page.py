# SPDX-License-Identifier: Apache-2.0
"""The numbers of the ESPRIT page on a short flight, and the attitudes of many cases."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from noting import noted
from presence import present

from css_analysis.spin_consistency import attitude_cases, attitude_error
from css_analysis.spin_figures import write_coning_figure, write_rate_figure, write_spectrum_figure
from css_common.mission import load_mission
from css_papers.esprit import attitude_figure
from css_papers.esprit.flights import attitude_errors, legs_of
from css_papers.esprit.numbers import alias_rows, angle_rows, fixed_axis_row, period_rows, rate_rows, true_max_min
from css_papers.esprit.spinning import fly_spinning
from css_papers.papers import find_paper


@pytest.fixture(scope="module")
def flight():
    """Deployments within the first seconds, two legs of 25 s after them."""
    return fly_spinning(
        load_mission(
            "esprit_2006",
            [
                "mission.duration=60",
                "payload.phase_starts=0,4,6,8",
                "payload.flat_spin_start=59",
                "coning.legs=8,33,33,58",
                "coning.interval=100",
            ],
        )
    )


def test_the_paper_is_found():
    assert find_paper("esprit").name == "esprit"


def test_rows_of_a_flight_are_what_they_must_be(flight):
    legs = legs_of(flight)
    rows = [
        *rate_rows(flight.mission, flight.passages),
        *angle_rows(legs, true_max_min(flight.mission, legs.up, flight.passages)),
        *alias_rows(legs, flight.mission),
    ]
    assert [row.quantity for row in rows if not row.ok] == []
    note = next(row.note for row in rows if "maxima" in row.quantity)
    assert "come from one sample a turn" in note and "from motion during a passage" in note


def test_periods_are_those_that_flew(flight):
    legs, flown = legs_of(flight), float(flight.mission.values.payload.coning_period[-1])
    rows = period_rows(legs, legs)
    assert [row.variant for row in rows] == ["", "", "drift", "drift"]
    for row, leg in zip(rows, [*legs, *legs], strict=True):
        assert row.here == pytest.approx(flown, abs=leg.resolution), row.quantity


def test_the_coning_node_says_what_the_page_says(flight):
    legs = legs_of(flight)
    assert set(flight.coning) == {0, 1}
    for leg, estimate in ((legs.up, flight.coning[0]), (legs.down, flight.coning[1])):
        assert estimate.full_angle == pytest.approx(leg.full_angle, abs=1e-6)
        assert estimate.period == pytest.approx(1.0 / leg.frequency, rel=1e-6)
        assert estimate.chosen == leg.chosen


def test_attitudes_of_a_flight_have_the_errors_they_say(flight):
    errors = attitude_errors(flight)
    steady = (errors.time > 12.0) & (errors.time < 58.0)
    assert np.count_nonzero(steady) > 200
    said = [a.covariance[0] + a.covariance[7] + a.covariance[14] for a in flight.attitudes]
    assert np.mean(errors.angle[steady] ** 2) == pytest.approx(np.mean(np.array(said)[steady]), rel=0.2)
    assert 2.4 < np.mean(errors.nees[steady]) < 3.6


def test_figures_are_written(flight, tmp_path):
    legs = legs_of(flight)
    windows = {"up-leg": legs.up, "down-leg": legs.down}
    files = [
        write_rate_figure(flight.passages, tmp_path / "rate.png", [(4.0, "separation")]),
        write_coning_figure(flight.passages, windows, tmp_path / "angle.png"),
        write_spectrum_figure(flight.passages, windows, tmp_path / "spectrum.png"),
    ]
    assert all(file.stat().st_size > 10_000 for file in files)


def test_the_attitudes_figure_shows_the_errors_and_how_many_cases_are_below_each(flight, tmp_path, monkeypatch):
    figures: list[Any] = []
    save = attitude_figure.save
    monkeypatch.setattr(
        attitude_figure, "save", lambda figure, path: noted(figures, figure, lambda: save(figure, path))
    )
    errors, nees = attitude_errors(flight), np.array([4.0, 1.0, 9.0, 2.0])
    cases: Any = SimpleNamespace(nees=nees)
    attitude_figure.write_attitude_figure(errors, cases, tmp_path / "attitude.png")
    above, below = figures[0].axes
    np.testing.assert_array_equal(above.lines[0].get_xydata(), np.column_stack([errors.time, np.degrees(errors.angle)]))
    cases, expected = below.lines
    np.testing.assert_array_equal(cases.get_xydata(), [[1.0, 0.125], [2.0, 0.375], [4.0, 0.625], [9.0, 0.875]])
    # 95 % of chi-square with three degrees of freedom is below 7.815
    assert np.interp(7.815, *expected.get_data()) == pytest.approx(0.95, abs=1e-3)


def test_a_fixed_axis_errs_by_less_than_two_counts():
    line = fixed_axis_row(load_mission("esprit_2006"))
    assert line.ok
    assert 0.3 < present(line.here) < 2.0


def test_attitude_errors_are_those_that_their_covariance_says_over_500_cases():
    """Mean NEES within the 95 % bounds of a mean of 500 chi-square numbers with 3 degrees of freedom."""
    cases = attitude_cases(load_mission("esprit_2006"), 500)
    assert len(cases.case) == 500
    bound = 1.96 * math.sqrt(2 * 3 / 500)
    assert abs(np.mean(cases.nees) - 3.0) < bound
    assert np.mean(cases.nees > 11.34) < 0.03
    assert 0.3 < np.degrees(np.ptp(cases.sun_angle)) / 100.0 < 0.7


def test_attitude_error_is_the_rotation_between_attitudes():
    angle = 0.02
    turn = np.array(
        [[1.0, 0.0, 0.0], [0.0, math.cos(angle), math.sin(angle)], [0.0, -math.sin(angle), math.cos(angle)]]
    )
    np.testing.assert_allclose(attitude_error(np.eye(3), turn), [angle, 0.0, 0.0], atol=1e-5)
