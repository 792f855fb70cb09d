# SPDX-License-Identifier: Apache-2.0
"""What outputs show by themselves: readings that stay the same, leaps, and what takes neither for the other."""

from types import SimpleNamespace

import numpy as np
import pytest

from css_calibration.fault_stretches import Outputs
from css_calibration.own_evidence import frozen_cells, own_evidence
from css_calibration.slow_faults import noisy_cells, spiky
from css_calibration.two_states import two_states

LEVELS = np.array([0.9, 0.85, 0.8, 0.05, 0.82])
SAMPLES = 2000


@pytest.fixture
def recorded():
    """A spacecraft that points: four cells in the Sun, one that is dark."""
    random = np.random.default_rng(3)
    loss = 1.0 - 0.03 * random.random(SAMPLES)
    voltages = np.outer(loss, LEVELS) + random.normal(0.0, 0.002, (SAMPLES, len(LEVELS)))
    return SimpleNamespace(voltages=voltages, gyro_b=np.zeros((0, 3)), period_s=0.2)


def outputs_of(recorded):
    evidence = own_evidence(recorded)
    none = np.zeros(recorded.voltages.shape, np.bool_)
    expected = np.broadcast_to(LEVELS, recorded.voltages.shape)
    return Outputs(np.arange(SAMPLES), recorded.voltages, expected, none, evidence.leaps, evidence.same, none)


def test_a_cell_that_reads_one_number_is_found_with_its_time(recorded):
    assert frozen_cells(recorded, own_evidence(recorded)) == {}
    recorded.voltages[700:, 1] = recorded.voltages[700, 1]
    found = frozen_cells(recorded, own_evidence(recorded))
    assert {i: (f.first, f.last, f.level) for i, f in found.items()} == {1: (700, 1999, recorded.voltages[700, 1])}


def test_a_coarse_converter_and_the_dark_are_no_faults(recorded):
    recorded.voltages = np.round(recorded.voltages * 64.0) / 64.0
    recorded.voltages[:, 3] = 0.0
    assert frozen_cells(recorded, own_evidence(recorded)) == {}


def test_spikes_are_told_from_noise(recorded):
    random = np.random.default_rng(4)
    assert spiky(outputs_of(recorded)) == {} and noisy_cells(recorded) == {}
    hit = np.flatnonzero(random.random(SAMPLES) < 0.08)
    hit = hit[hit > 600]
    recorded.voltages[hit, 0] += 0.5 * np.sign(random.random(len(hit)) - 0.5)
    found = spiky(outputs_of(recorded))
    assert list(found) == [0] and hit[0] <= found[0][0] <= hit[0] + 2
    assert noisy_cells(recorded) == {}
    recorded.voltages[:, 2] += random.normal(0.0, 0.08, SAMPLES)
    assert list(noisy_cells(recorded)) == [2]


def test_the_likeliest_of_two_states_ignores_what_is_short():
    says = np.full(100, -1.0)
    says[40:43] = 3.0
    assert not two_states(says, 14.0).any()
    says[40:60] = 3.0
    assert np.array_equal(np.flatnonzero(two_states(says, 14.0)), np.arange(40, 60))
