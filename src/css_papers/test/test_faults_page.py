# SPDX-License-Identifier: Apache-2.0
"""The page on faults: what flies, how a line is measured, and what two failed cells leave to be seen."""

import math

import numpy as np
import pytest
from presence import present

from css_common.kernel import typed_call
from css_common.mission import load_mission
from css_estimation.sun import pyramid_switch
from css_monte_carlo.mission_flight import MissionFlight
from css_papers.faults import paper
from css_papers.faults.blind import DIM, harmless_pairs, sights
from css_papers.faults.kinds import CELL, NONE, PAIR, cell_faults, gyro_faults, pairs, rod_faults, wheel_faults
from css_papers.faults.measured import FALSE, counted_cases, failed_cells, outcome
from css_papers.faults.missions import absent, absents, subjects
from css_papers.papers import Request, find_paper
from css_sim.fault_kinds import KINDS

SUBJECTS = subjects()
BY_LABEL = {subject.label: subject for subject in SUBJECTS}


@pytest.mark.parametrize("subject", SUBJECTS, ids=lambda subject: subject.label)
def test_every_line_is_a_mission(subject):
    mission = subject.loaded(quick=True)
    for fault in subject.faults(quick=False):
        flown = subject.configuration(fault, quick=False).applied(mission)
        assert flown.values.graph.estimator == subject.estimator
        assert len(flown.faults) == len(fault.entries)


def test_every_kind_of_cell_wheel_rod_and_gyro_is_flown():
    flown = {(e.target.partition(".")[0], e.kind) for f in cell_faults() for e in f.entries}
    flown |= {
        (e.target.partition(".")[0], e.kind)
        for g in (wheel_faults, lambda: rod_faults(0.1), gyro_faults)
        for f in g()
        for e in f.entries
    }
    sorts = ("cell", "wheel", "rod", "gyro")
    left = {(kind.sort, kind.name) for kind in KINDS if kind.sort in sorts} - flown
    # what differs from a kind that flies in nothing but its value
    assert left == {("cell", "stuck_random"), ("gyro", "saturated")}


@pytest.mark.parametrize("subject", [s for s in SUBJECTS if CELL in s.sorts], ids=lambda subject: subject.label)
def test_missions_without_a_cell_have_it_not(subject):
    mission = subject.loaded(quick=True)
    normals = np.asarray(mission.values.cells.normals).reshape(-1, 3)
    found = list(absents(subject, mission))
    # the safe-hold estimators ask for a cell on each face, and some faces have but one
    alone = {0, 1, 10} if subject.mission.startswith("clark") else set()
    assert {cell for each in found for cell in each.cells} == set(range(len(normals))) - alone
    for lacking in found:
        flown = lacking.configuration.applied(mission)
        kept = np.asarray(flown.values.cells.normals).reshape(-1, 3)
        if len(kept) < len(normals):
            np.testing.assert_allclose(kept, np.delete(normals, lacking.cells, axis=0))


def test_a_pyramid_that_lacks_a_cell_is_not_used():
    subject = BY_LABEL["Clark, pyramid"]
    mission = subject.loaded(quick=True)
    flat = absent(subject, mission, (2,)).configuration.applied(mission)
    assert flat.node("css_array").values.collar.cells.tolist() == [10, 11, 12]
    flown = absent(subject, mission, (12,)).configuration.applied(mission)
    pyramid = pyramid_switch.parameters(flown.node("pyramid_switch").values).pyramid
    for bright in (0.0, 0.999):
        assert not typed_call(pyramid_switch.pyramid_heading)(pyramid, np.full(14, bright))[1]


def columns(**given):
    usual = {name: np.zeros(3) for name in (*FALSE, "converging_s", "misnamed_units")}
    usual |= {
        name: np.full(3, np.nan) for name in ("fault_shown_s", "detected_s", "nis_mean", "heading_error_mean_deg")
    }
    usual["power_positive_from_s"] = np.ones(3)
    values = usual | {name: np.array(column, float) for name, column in given.items()}
    return values.__getitem__


ALL, ONES = np.ones(3, bool), [frozenset([i]) for i in (0, 1, 0)]


def test_later_is_against_the_same_case_without_the_fault():
    of, without = columns(converging_s=[100.0, 250.0, 90.0]), columns(converging_s=[80.0, 100.0, 100.0])
    found = outcome(of, without, ALL, {}, ONES)
    assert (found.later_median, found.later_max) == (20.0, 150.0)
    never = outcome(columns(converging_s=[np.nan, 1.0, 1.0]), without, ALL, {}, ONES)
    assert never.later_max == math.inf
    assert outcome(columns(), columns(converging_s=[np.nan] * 3), ALL, {}, ONES).later_max == 0.0


def test_errors_are_over_those_of_the_mission_without_the_cell_that_fails_in_the_case():
    lacking = {frozenset([0]): np.array([1.0, 99.0, 3.0]), frozenset([1]): np.array([99.0, 2.0, 99.0])}
    of = columns(heading_error_mean_deg=[2.0, 3.0, 4.0])
    assert outcome(of, columns(), ALL, lacking, ONES).ratio == pytest.approx(9.0 / 6.0)
    assert outcome(of, columns(), np.array([True, False, False]), lacking, ONES).ratio == pytest.approx(2.0)
    assert outcome(of, columns(), ALL, {}, ONES).ratio is None


def test_found_is_asked_of_the_cases_in_which_a_fault_shows():
    of = columns(
        fault_shown_s=[5.0, 5.0, np.nan],
        detected_s=[3.0, 11.0, np.nan],
        power_positive_from_s=[1.0, np.nan, 1.0],
        false_isolations=[0, 1, 2],
        falsely_left_sensors=[0, 0, 1],
    )
    found = outcome(of, columns(), ALL, {}, ONES)
    assert (found.shown, found.detected, found.promptly) == (2, 1.0, 0.5)
    assert found.named == 1.0
    assert found.detected_median == 7.0 and found.detected_p95 == pytest.approx(10.6)
    assert found.false == 4 and found.power == pytest.approx(2.0 / 3.0)
    wrong = columns(fault_shown_s=[5.0] * 3, detected_s=[3.0, 3.0, np.nan], misnamed_units=[1, 0, 1])
    assert outcome(wrong, columns(), ALL, {}, ONES).named == 0.5
    assert outcome(wrong, columns(), ALL, {}, [frozenset()] * 3).named is None
    missed = outcome(columns(fault_shown_s=[5.0, 5.0, 5.0], detected_s=[3.0, np.nan, np.nan]), columns(), ALL, {}, ONES)
    assert missed.detected == pytest.approx(1.0 / 3.0) and missed.promptly == pytest.approx(1.0 / 3.0)


def test_the_cells_that_fail_are_those_that_fly():
    subject = BY_LABEL["wavg"]
    mission = subject.loaded(quick=True)
    swapped = next(fault for fault in cell_faults() if fault.entries[0].kind == "swapped")
    flown = subject.configuration(swapped, True).applied(mission)
    cases = MissionFlight(flown).cases(np.arange(30))[0]
    assert failed_cells(flown, 30) == [frozenset(units) for units in cases.faults["unit"].tolist()]


def test_a_line_without_cases_has_no_numbers():
    found = outcome(columns(), columns(), np.zeros(3, bool), {}, ONES)
    assert (found.cases, found.power, found.later_median, found.later_max, found.named) == (0, None, None, None, None)


def test_a_pair_is_two_cells():
    subject = BY_LABEL["wavg"]
    mission, pair = subject.loaded(quick=True), next(pairs())
    failed = failed_cells(subject.configuration(pair, True).applied(mission), 40)
    counted = counted_cases(pair, failed)
    assert pair.sort == PAIR and 0 < counted.sum() < 40
    assert all((len(cells) == 2) == taken for cells, taken in zip(failed, counted, strict=True))
    # each of eight cells is as likely as the others to be one of the two
    many = failed_cells(subject.configuration(pair, True).applied(mission), 400)
    hits = np.bincount([cell for cells in many for cell in cells], minlength=8)
    assert hits.min() > 0.5 * hits.mean()
    assert counted_cases(NONE, failed_cells(mission, 3)).all()


def test_what_two_of_six_faces_leave_is_known():
    """Without the cells on +x and +y a quarter of the sky has one lit cell left, without those on +x and -x none."""
    mission = load_mission("cubesat_3u_safe")
    (whole,) = sights(mission, 0, dim=0.0)
    assert whole[1:] == (0.0, 0.0, 0.0, 0.0)
    by_cells = {sight.cells: sight for sight in sights(mission, 2, dim=0.0)}
    assert len(by_cells) == 15
    beside, opposite = by_cells[0, 2], by_cells[0, 1]
    assert beside.blind == 0.0 and beside.cone == pytest.approx(0.25, abs=0.01)
    assert (opposite.blind, opposite.cone) == (0.0, 0.0)
    # about +x, half of the directions near it have y above zero
    assert beside.cone_in_power == pytest.approx(0.5, abs=0.01)


def test_a_cell_that_reads_no_more_than_the_earth_gives_sees_no_sun():
    """About each axis of six faces is a square pyramid of directions that are below DIM on both other axes."""
    (whole,) = sights(load_mission("cubesat_3u_safe"), 0)
    directions = np.random.default_rng(1).normal(size=(200_000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    lit = np.count_nonzero(np.abs(directions) >= DIM, axis=1)
    assert whole.blind == 0.0 and whole.cone == pytest.approx(np.mean(lit == 1), abs=0.004)


def test_pairs_that_leave_the_sun_in_sight_in_power():
    """Of the eight cells of the paper, four see the Sun about the array normal, and any two of the others may fail."""
    harmless = set(map(tuple, map(sorted, harmless_pairs(load_mission("okeefe_2013")))))
    assert {(4, 5), (4, 6), (6, 7)} <= harmless and not {(0, 1), (0, 2), (2, 3)} & harmless
    # of six faces only the one that looks away from the Sun is never lit in power: no pair is to spare
    assert harmless_pairs(load_mission("cubesat_3u_safe")) == []


def test_power_is_told_apart_where_enough_cells_are_left():
    of = columns(power_positive_from_s=[1.0, np.nan, 1.0])
    found = outcome(of, columns(), ALL, {}, ONES, [frozenset([0])])
    assert found.power == pytest.approx(2.0 / 3.0) and found.power_seen == 1.0
    assert outcome(of, columns(), ALL, {}, ONES).power_seen is None


def test_a_short_flight_gives_a_page(tmp_path, monkeypatch):
    chosen = [BY_LABEL["ekf"]._replace(changes=(*BY_LABEL["ekf"].changes, "mission.period=0.5"))]
    monkeypatch.setattr(paper, "subjects", lambda: chosen)
    rows = find_paper("faults").reproduce(Request(tmp_path, 2, True))
    by_name = {row.quantity: row for row in rows}
    assert {row.variant for row in rows} == {"ekf"}
    assert present(by_name["no fault: in power"].here) == 1.0
    assert by_name["cell dead: error / without the cell"].must is not None
    assert by_name["pair dead and dead: later, most"].must is None
    text = (tmp_path / "README.md").read_text(encoding="utf-8")
    for fault in chosen[0].faults(quick=True):
        assert f"| {fault.label} " in text
    assert "What two failed cells leave to be seen" in text and "## What is missed" in text


def test_the_page_flies_fewer_cases_than_papers_do():
    assert present(find_paper("faults").cases) < 1000
    assert find_paper("okeefe").cases is None
