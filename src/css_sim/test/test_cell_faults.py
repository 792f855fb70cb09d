# SPDX-License-Identifier: Apache-2.0
"""Failed cells: their times, the draws of a case, and what the cells then read."""

import math

import numpy as np
import pytest
from okeefe_spacecraft import okeefe_values
from scipy import stats

from css_common.fault_lines import conflicts
from css_common.mission_section import MISSION
from css_common.random_streams import random_key
from css_sensors.cells import CELLS
from css_sim import cell_faults
from css_sim.cell_faults import case_faults
from css_sim.fault_effects import CELL, DEAD, FAULT, STUCK, spoil
from css_sim.faults import rows

KEY = random_key(3, 1)
SIGNIFICANCE = 1e-4
CASES = 4000


def values_with(faults=(), **random_faults):
    changes = {f"random_faults__{name}": value for name, value in random_faults.items()}
    return okeefe_values(MISSION + CELLS + cell_faults.PARAMETERS, faults=list(faults), **changes)


def same(faults, others):
    """Whether two tables say the same, at whatever places; what none has held yet is NaN in both."""
    names = [name for name in FAULT.names or () if name != "index"]
    return all(np.array_equal(faults[name], others[name], equal_nan=name == "held") for name in names)


def faults_with(*texts, key=KEY, **random_faults):
    return rows(case_faults(values_with(texts, **random_faults), key))


def drawn(**random_faults):
    """Faults (CASES, F) of many cases."""
    values = values_with(**random_faults)
    return np.stack([rows(case_faults(values, random_key(11, case))) for case in range(CASES)])


def test_conflicts_name_the_fault():
    assert list(cell_faults.conflicts(values_with(["0 dead", "7 stuck 1.0"], count=8))) == []
    (many,) = cell_faults.conflicts(values_with(count=9))
    assert many == "random_faults.count: 9 given, expected at most the number of cells, 8"
    values = values_with(["1 swapped 8", "2 swapped 7"])
    (other,) = conflicts(values.faults, cell_faults.KINDS, cell_faults.units(values))
    assert "other 8 given, expected a cell from 0 to 7" in other


def test_a_fault_lasts_from_the_first_cycle_at_its_time_to_the_last_before_its_end():
    faults = faults_with("1 stuck 0.8 from 0.3 to 0.55")
    for step in range(10):
        voltages = np.full(3, 0.5)
        spoil(faults, CELL, KEY, step, voltages)
        assert voltages.tolist() == [0.5, 0.8 if 3 <= step <= 5 else 0.5, 0.5]


def test_later_faults_act_on_what_earlier_ones_left():
    faults = faults_with("0 dead", "0 stuck 0.2 from 1", "2 dead", "7 dead")
    voltages = np.full(3, 0.5)
    spoil(faults, CELL, KEY, 0, voltages)
    assert voltages.tolist() == [0.0, 0.5, 0.0]
    spoil(faults, CELL, KEY, 10, voltages)
    assert voltages.tolist() == [0.2, 0.5, 0.0]


def test_noisy_cell_is_right_in_the_mean_and_normal():
    faults = faults_with("1 noisy 0.1", "2 noisy 0.1")
    samples = np.full((5000, 3), 0.5)
    for step, voltages in enumerate(samples):
        spoil(faults, CELL, KEY, step, voltages)
    assert np.all(samples[:, 0] == 0.5)
    for i in (1, 2):
        assert stats.kstest(samples[:, i], "norm", (0.5, 0.1)).pvalue > SIGNIFICANCE
    assert stats.pearsonr(samples[:, 1], samples[:, 2]).pvalue > SIGNIFICANCE


def test_noise_does_not_depend_on_the_order_of_steps():
    faults = faults_with("1 noisy 0.1")
    steps = np.random.default_rng(1).permutation(200)
    samples = np.zeros((200, 3))
    for step in steps:
        spoil(faults, CELL, KEY, step, samples[step])
    for step in range(200):
        again = np.zeros(3)
        spoil(faults, CELL, KEY, step, again)
        assert np.array_equal(samples[step], again)


def test_no_failure_is_drawn_unless_asked_for():
    assert faults_with().shape == (0,)
    assert faults_with().dtype == FAULT


@pytest.mark.parametrize("count", [1, 2, 3])
def test_every_set_of_different_cells_fails_equally_often(count):
    cells = np.sort(drawn(count=count)["unit"], axis=1)
    sets, times = np.unique(cells, axis=0, return_counts=True)
    assert np.all(np.diff(sets, axis=1) > 0)
    assert len(sets) == math.comb(8, count)
    assert stats.chisquare(times).pvalue > SIGNIFICANCE


def test_all_cells_can_fail():
    assert np.array_equal(np.sort(drawn(count=8)["unit"], axis=1), np.tile(np.arange(8), (CASES, 1)))


def test_more_failures_include_those_of_fewer():
    assert same(drawn(count=5, kind="mixed")[:, :2], drawn(count=2, kind="mixed"))


def test_dead_and_stuck_cells():
    dead, stuck = drawn(count=2), drawn(count=2, kind="stuck", value=0.7)
    assert np.all(dead["kind"] == DEAD) and np.all(stuck["kind"] == STUCK)
    assert np.all(stuck["value"] == 0.7)
    assert np.array_equal(dead["unit"], stuck["unit"])


def test_drawn_outputs_are_uniform_and_independent_of_the_cell():
    faults = drawn(count=2, kind="stuck")
    for k in (0, 1):
        assert stats.kstest(faults["value"][:, k], "uniform").pvalue > SIGNIFICANCE
    assert stats.pearsonr(*faults["value"].T).pvalue > SIGNIFICANCE
    assert stats.pearsonr(faults["unit"][:, 0], faults["value"][:, 0]).pvalue > SIGNIFICANCE


def test_mixed_failures_are_dead_or_stuck_equally_often_and_independently():
    kinds = drawn(count=2, kind="mixed")["kind"]
    times = [np.count_nonzero(np.all(kinds == pair, axis=1)) for pair in ((0, 0), (0, 1), (1, 0), (1, 1))]
    assert (DEAD, STUCK) == (0, 1) and sum(times) == CASES
    assert stats.chisquare(times).pvalue > SIGNIFICANCE


def test_failures_of_a_case_are_always_the_same_and_those_of_cases_and_seeds_differ():
    changes = {"count": 3, "kind": "stuck"}
    first = faults_with(key=random_key(1, 0), **changes)
    assert same(first, faults_with(key=random_key(1, 0), **changes))
    for other in (random_key(1, 1), random_key(2, 0), random_key(1 << 32, 0)):
        assert not np.array_equal(first["value"], faults_with(key=other, **changes)["value"])


def test_drawn_failures_follow_the_faults_of_the_mission_and_leave_their_noise_alone():
    scripted = faults_with("1 noisy 0.1", "2 noisy 0.2 from 1")
    both = faults_with("1 noisy 0.1", "2 noisy 0.2 from 1", count=2)
    assert same(both[:2], scripted)
    assert same(both[2:], faults_with(count=2))
    healthy = np.setdiff1d(np.arange(8), both["unit"][2:])
    alone, together = np.full(8, 0.5), np.full(8, 0.5)
    spoil(scripted, CELL, KEY, 40, alone)
    spoil(both, CELL, KEY, 40, together)
    assert np.array_equal(alone[healthy], together[healthy])
    assert np.all(together[both["unit"][2:]] == 0.0)


@pytest.mark.parametrize(("time", "first"), [(0.0, 0), (0.3, 3), (0.35, 4)])
def test_drawn_failures_begin_at_their_time_and_stay(time, first):
    faults = faults_with(count=8, kind="stuck", value=0.9, time=time)
    for step in (0, first - 1, first, 10**9):
        voltages = np.full(8, 0.5)
        spoil(faults, CELL, KEY, step, voltages)
        assert np.all(voltages == (0.9 if step >= first else 0.5))
