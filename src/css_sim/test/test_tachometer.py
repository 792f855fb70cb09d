# SPDX-License-Identifier: Apache-2.0
"""What tachometers make of the speeds of the wheels."""

import numpy as np

from css_common.random_streams import random_key
from css_sim.fault_effects import NO_FAULTS
from css_sim.tachometer import Tachometer, report

KEY = random_key(3, 7)


def test_speeds_are_rounded_to_whole_steps():
    speeds = np.array([0.0, 0.4, -0.4, 0.6, -0.6, 123.4])
    report(Tachometer(0.0, 1.0), NO_FAULTS, KEY, 0, speeds)
    np.testing.assert_array_equal(speeds, [0.0, 0.0, 0.0, 1.0, -1.0, 123.0])


def test_noise_is_white_and_each_wheel_has_its_own():
    true = np.array([10.0, -20.0, 30.0, 0.0, 5.0])
    rows = []
    for step in range(2000):
        speeds = true.copy()
        report(Tachometer(0.3, 0.0), NO_FAULTS, KEY, step, speeds)
        rows.append(speeds - true)
    errors = np.array(rows)
    np.testing.assert_allclose(errors.std(axis=0), 0.3, rtol=0.06)
    np.testing.assert_allclose(errors.mean(axis=0), 0.0, atol=0.03)
    assert np.max(np.abs(np.corrcoef(errors.T) - np.eye(5))) < 0.1
    assert abs(np.corrcoef(errors[:-1, 0], errors[1:, 0])[0, 1]) < 0.1
