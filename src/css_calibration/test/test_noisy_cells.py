# SPDX-License-Identifier: Apache-2.0
"""Which cells are noisy: more than others that are as bright, whatever noise goes with the light."""

from types import SimpleNamespace

import numpy as np
import pytest

from css_calibration.slow_faults import noisy_cells

LEVELS = np.array([0.9, 0.85, 0.8, 0.05, 0.06, 0.05, 0.04, 0.07])
"""Three cells in the Sun, five that see the Earth alone: a spacecraft that points."""


@pytest.fixture
def recorded():
    random = np.random.default_rng(7)
    time = np.arange(600.0)
    loss = 1.0 - 0.05 * random.random(600)  # of all cells together, as large as it is bright
    moving = 1.0 + 0.05 * np.sin(0.01 * time)
    voltages = np.outer(loss * moving, LEVELS) + random.normal(0.0, 0.002, (600, 8))
    return SimpleNamespace(voltages=voltages)


def test_lit_cells_are_not_noisy_for_a_loss_that_goes_with_the_light(recorded):
    assert noisy_cells(recorded) == {}


@pytest.mark.parametrize("cell", [1, 5])
def test_a_cell_that_is_noisier_than_others_as_bright_is_named(recorded, cell):
    recorded.voltages[:, cell] += np.random.default_rng(8).normal(0.0, 0.08, 600)
    found = noisy_cells(recorded)
    assert list(found) == [cell]
    assert "where others as bright have" in found[cell].evidence
