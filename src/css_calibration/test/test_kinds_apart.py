# SPDX-License-Identifier: Apache-2.0
"""Kinds of faults that a stretch tells apart, and those that it does not: named, not guessed."""

import numpy as np
import pytest

from css_calibration.fault_stretches import Outputs
from css_calibration.kinds_apart import kinds_in
from css_common.health import KIND_BIAS, KIND_DEAD, KIND_DRIFTING, KIND_SATURATED, KIND_SCALED, KIND_STUCK

TIME = np.arange(400.0)
TURNING = 0.5 + 0.4 * np.sin(0.05 * TIME)
STILL = np.full(400, 0.7)


def kinds(expected, read, kind):
    noise = np.random.default_rng(5).normal(0.0, 0.01, len(TIME))
    none = np.zeros((len(TIME), 1), np.bool_)
    outputs = Outputs(TIME, (read + noise)[:, None], expected[:, None], none, none, none, none)
    found = kinds_in(outputs, 0, 0, len(TIME) - 1, kind)
    return found.best, set(found.others)


@pytest.mark.parametrize("taken_for", [KIND_BIAS, KIND_SCALED])
def test_changing_light_tells_a_scale_from_a_level(taken_for):
    assert kinds(TURNING, 0.5 * TURNING, taken_for) == (KIND_SCALED, set())
    assert kinds(TURNING, TURNING + 0.3, taken_for) == (KIND_BIAS, set())


@pytest.mark.parametrize("taken_for", [KIND_BIAS, KIND_SCALED])
def test_light_that_stays_the_same_does_not(taken_for):
    best, others = kinds(STILL, 0.5 * STILL, taken_for)
    assert best == taken_for and others == {KIND_BIAS, KIND_SCALED} - {taken_for}


def test_what_grows_is_a_drift():
    best, _ = kinds(TURNING, TURNING + 0.001 * TIME, KIND_BIAS)
    assert best == KIND_DRIFTING


def test_a_limit_follows_the_light_below_it_and_a_stuck_cell_does_not():
    assert kinds(TURNING, np.minimum(TURNING, 0.5), KIND_STUCK) == (KIND_SATURATED, set())
    assert kinds(TURNING, np.full(400, 0.5), KIND_SATURATED) == (KIND_STUCK, set())
    # never less light than the level: both would read so
    assert kinds(STILL, np.full(400, 0.5), KIND_STUCK) == (KIND_STUCK, {KIND_SATURATED})


def test_other_kinds_stay():
    assert kinds(TURNING, np.zeros(400), KIND_DEAD) == (KIND_DEAD, set())
