# SPDX-License-Identifier: Apache-2.0
"""Failed cells: the mission's text form, the times, and what the cells then read."""

import math

import numpy as np
import pytest
from scipy import stats

from css_common.random_streams import random_key
from css_sim import cell_faults as cell_faults_module
from css_sim.cell_faults import (
    DEAD,
    NOISY,
    STUCK,
    Fault,
    apply_faults,
    cell_faults,
    parse_fault,
)

KEY = random_key(3, 1)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("2 dead", Fault(2, DEAD, 0.0, 0.0, math.inf)),
        ("5 stuck 0.8 from 1200 to 1800.5", Fault(5, STUCK, 0.8, 1200.0, 1800.5)),
        ("0 noisy 0.1 from 60", Fault(0, NOISY, 0.1, 60.0, math.inf)),
        ("1 dead to 30", Fault(1, DEAD, 0.0, 0.0, 30.0)),
    ],
)
def test_text_form(text, fault):
    assert parse_fault(text) == fault


@pytest.mark.parametrize(
    "text",
    ["", "dead", "2", "x dead", "-1 dead", "2 broken", "2 stuck", "2 stuck high", "2 dead 0.5", "2 dead from",
     "2 dead from 9 to 3", "2 noisy -0.1", "2 stuck nan", "2 dead to 3 from 1", "2 stuck 0.5 0.6"],
)  # fmt: skip
def test_wrong_text_is_refused(text):
    with pytest.raises(ValueError, match="expected CELL"):
        parse_fault(text)


def test_conflicts_name_the_fault():
    assert list(cell_faults_module.conflicts(["0 dead", "7 stuck 1.0"], 8)) == []
    wrong = list(cell_faults_module.conflicts(["8 dead", "oops"], 8))
    assert "'8 dead' given, expected a cell from 0 to 7" in wrong[0]
    assert "'oops'" in wrong[1]


def test_a_fault_lasts_from_the_first_cycle_at_its_time_to_the_last_before_its_end():
    faults = cell_faults(["1 stuck 0.8 from 0.3 to 0.55"], 0.1)
    for step in range(10):
        voltages = np.full(3, 0.5)
        apply_faults(faults, KEY, step, voltages)
        assert voltages.tolist() == [0.5, 0.8 if 3 <= step <= 5 else 0.5, 0.5]


def test_later_faults_act_on_what_earlier_ones_left():
    faults = cell_faults(["0 dead", "0 stuck 0.2 from 1", "2 dead", "9 dead"], 0.1)
    voltages = np.full(3, 0.5)
    apply_faults(faults, KEY, 0, voltages)
    assert voltages.tolist() == [0.0, 0.5, 0.0]
    apply_faults(faults, KEY, 10, voltages)
    assert voltages.tolist() == [0.2, 0.5, 0.0]


def test_noisy_cell_is_right_in_the_mean_and_normal():
    faults = cell_faults(["1 noisy 0.1", "2 noisy 0.1"], 0.1)
    samples = np.full((5000, 3), 0.5)
    for step, voltages in enumerate(samples):
        apply_faults(faults, KEY, step, voltages)
    assert np.all(samples[:, 0] == 0.5)
    for i in (1, 2):
        assert stats.kstest(samples[:, i], "norm", (0.5, 0.1)).pvalue > 1e-4
    assert stats.pearsonr(samples[:, 1], samples[:, 2]).pvalue > 1e-4
