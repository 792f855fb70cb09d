# SPDX-License-Identifier: Apache-2.0
"""Which cells of a flight lie: each kind of fault, put on the outputs of a flight that is healthy, and flown ones."""

import json

import numpy as np
import pytest
from faulted_cells import FAULTS, faulted
from synthetic_flight import record
from uncalibrated import Flown, flown, mission_of, sun_alone, without_truth

from css_calibration.check import CELLS, Checked, check
from css_calibration.commands import check as command
from css_calibration.recorded import Recorded
from css_calibration.verdicts import HEALTHY, UNTOLD

BEGIN = 700  # instant
FAILING = 1


@pytest.fixture(scope="module")
def flight() -> Flown:
    return flown(mission_of("mission.case=0", "css_array.scale_cell_error=0.05", "css_array.misalignment_deg=1.0"))


def spoiled(recorded: Recorded, spoil) -> Recorded:
    """Every second instant, with the outputs of one cell changed from `BEGIN` on."""
    some = recorded.at(np.arange(0, len(recorded.stamp_ns), 2))
    spoil(some.voltages[BEGIN // 2 :], np.random.default_rng(1))
    return some


def verdicts(checked: Checked) -> dict[int, str]:
    return {v.cell: v.verdict for v in checked.verdicts if v.accuses}


def dead(v, rng):
    v[:, FAILING] = 0.0


def stuck(v, rng):
    v[:, FAILING] = 0.4


def noisy(v, rng):
    v[:, FAILING] += 0.1 * rng.normal(size=len(v))


def scaled(v, rng):
    v[:, FAILING] *= 0.4


def bias(v, rng):
    v[:, FAILING] += 0.3


def sign(v, rng):
    v[:, FAILING] *= -1.0


def saturated(v, rng):
    v[:, FAILING] = np.minimum(v[:, FAILING], 0.45)


def swapped(v, rng):
    v[:, [FAILING, 3]] = v[:, [3, FAILING]]


def drifting(v, rng):
    v[:, FAILING] += 0.0004 * 2.0 * np.arange(len(v))


@pytest.mark.parametrize("spoil", [dead, stuck, noisy, scaled, bias, sign, saturated, swapped, drifting])
def test_each_kind_is_found_by_name_and_time(flight, spoil):
    checked = check(spoiled(flight.recorded, spoil))
    found = verdicts(checked)
    assert found == dict.fromkeys((FAILING, 3), "swapped") if spoil is swapped else found == {FAILING: spoil.__name__}
    first = next(v for v in checked.verdicts if v.cell == FAILING)
    begin = (first.first_ns - flight.recorded.stamp_ns[0]) * 1e-9
    if spoil not in (noisy, drifting):  # noise and age are told for all of the recording
        # not before it began, but for a neighbour in time, and not before it shows
        assert begin >= BEGIN - 20.0
    assert first.evidence


@pytest.mark.parametrize("case", [2, 3])
def test_light_of_an_earth_that_nobody_predicts_makes_no_cell_a_liar(case):
    """Four cells that look away from the Sun read the Earth or nothing; by a mean of both they were dead or biased."""
    recorded = without_truth(flown(faulted("okeefe_2013", case, None)))
    assert verdicts(check(recorded, reference="cells")) == {}


def test_healthy_cells_are_called_so_by_every_reference(flight):
    for recorded, every in ((flight.recorded, 2), (without_truth(flight), 4)):
        some = recorded.at(np.arange(0, len(recorded.stamp_ns), every))
        assert check(some).healthy
    by_vote = check(sun_alone(flight).at(np.arange(0, 3000, 3)), reference="cells")
    assert by_vote.reference == CELLS and by_vote.healthy


@pytest.mark.parametrize("spoil", [dead, stuck, scaled, swapped])
def test_the_vote_of_the_cells_along_rates_finds_one_that_loses_light(flight, spoil):
    checked = check(spoiled(flight.recorded, spoil), reference="cells")
    found = verdicts(checked)
    assert found == dict.fromkeys((FAILING, 3), "swapped") if spoil is swapped else found == {FAILING: spoil.__name__}
    assert any("nothing but the cells" in note for note in checked.notes)
    assert any("rates hold the Sun still" in note for note in checked.notes)


@pytest.mark.parametrize("kind", ["stuck_high", "drifting"])
def test_a_liar_has_no_say_in_where_the_sun_was_by_which_others_are_judged(kind):
    """Cell 2 was called biased: the Sun of the first vote stood where the failing cell had drawn it."""
    recorded = without_truth(flown(faulted("tumble", 201, kind)))
    found = verdicts(check(recorded, reference="cells"))
    assert found == {0: {"stuck_high": "stuck"}.get(kind, kind)}


def test_without_rates_the_vote_is_of_each_instant_and_accuses_nobody_wrongly(flight):
    recorded = spoiled(flight.recorded, stuck)
    recorded.gyro_ns, recorded.gyro_b = recorded.gyro_ns[:0], recorded.gyro_b[:0]
    checked = check(recorded, reference="cells")
    assert verdicts(checked) == {FAILING: "stuck"}
    assert any("a fault that another Sun explains" in note for note in checked.notes)


POINTING = {"saturated": "stuck", "frozen": "stuck", "drifting": "drifting", "bias": "bias", "spikes": "spikes"}


@pytest.mark.parametrize("kind", POINTING)
def test_of_a_spacecraft_that_points_the_failing_cell_alone_is_accused(kind):
    """Cells in the Sun from one side alone, at the edges of their views, and half of them in the dark for ever."""
    recorded = flown(faulted("okeefe_2013", 0, kind)).recorded
    checked = check(recorded.at(np.arange(0, len(recorded.stamp_ns), 3)))
    assert verdicts(checked) == {0: POINTING[kind]}
    (verdict,) = [v for v in checked.verdicts if v.cell == 0]
    # a limit that the light is never below reads like a cell that is stuck there, and the other way round
    assert set(verdict.others) <= ({"saturated"} if POINTING[kind] == "stuck" else set())
    assert kind != "saturated" or verdict.others
    never_lit = [v for v in checked.verdicts if v.evidence.startswith("never in the Sun")]
    assert never_lit and {v.verdict for v in never_lit} == {UNTOLD}


def test_a_shadow_of_structure_is_mapped(flight):
    recorded = flight.recorded.at(np.arange(len(flight.recorded.stamp_ns)))
    assert recorded.sun_b is not None
    lit = np.flatnonzero(recorded.voltages[:, FAILING] > 0.5)
    axis = recorded.sun_b[lit[len(lit) // 2]]
    hidden = recorded.sun_b @ axis > np.cos(np.radians(20.0))
    recorded.voltages[hidden, FAILING] *= 0.4
    checked = check(recorded)
    assert verdicts(checked) == {FAILING: "shadowed"}
    (verdict,) = [v for v in checked.verdicts if v.cell == FAILING]
    assert all(np.dot(direction, axis) > np.cos(np.radians(32.0)) for direction in verdict.directions_b)


def test_a_cell_that_ages_drifts(flight):
    recorded = flight.recorded.at(np.arange(len(flight.recorded.stamp_ns)))
    recorded.voltages[:, FAILING] *= 1.0 - 0.2 * recorded.time / recorded.time[-1]
    checked = check(recorded)
    assert verdicts(checked) == {FAILING: "drifting"}
    (verdict,) = [v for v in checked.verdicts if v.cell == FAILING]
    assert "over the recording" in verdict.evidence


def test_a_cell_without_readings_is_silent(flight):
    def silent(v, rng):
        v[:, FAILING] = np.nan

    assert verdicts(check(spoiled(flight.recorded, silent))) == {FAILING: "silent"}


def test_a_fault_that_flew_is_told_by_the_command(tmp_path, capsys):
    mission = faulted("tumble", 0, "dead")
    flight = flown(mission)
    kinds = {f"/{topic}": (mission.topics[topic], columns) for topic, columns in flight.columns.items()}
    bag = record(tmp_path / "bag", kinds, mission.text())
    assert command.main([str(bag), "--json"]) == 1
    *screen, last = capsys.readouterr().out.splitlines()
    cells = {row["cell"]: row for row in json.loads(last)["cells"]}
    assert cells[0]["verdict"] in FAULTS["dead"].names
    assert cells[0]["from"] >= "2013-06-01T00:16:30"
    assert {row["verdict"] for cell, row in cells.items() if cell} == {HEALTHY}
    assert {"cell", "verdict", "evidence", "from", "to"} <= set(cells[3])
    assert "7 of 8 cells are healthy" in " ".join(screen)
