# SPDX-License-Identifier: Apache-2.0
"""When an estimator is worse off with a calibration, by how much more than chance, and what is said of it."""

from typing import Any

import numpy as np
import pytest

from css_calibration.batch_fit import Fit, _beside_earth
from css_calibration.calibration import Calibration, left_of, told
from css_calibration.estimator_gain import Gain, LeftOut, half_interval, worse_lines
from css_calibration.noise_model import Noise
from css_calibration.unknowns import Ignorance, all_of

CELLS = 2


def gain(before, after, interval: float | None = 0.4, left_out=()) -> Gain:
    return Gain("any", before, after, interval, 400, tuple(left_out))


def linear_fit(information: np.ndarray, x: np.ndarray) -> Fit:
    """A fit whose problem is linear; of each cell scale, dark level and tilts."""
    unknowns = all_of(CELLS, temperature=False, earth=False, ignorance=Ignorance())
    covariance = np.linalg.inv(information + np.eye(len(x)))
    residuals = np.full((10, CELLS), 0.01)
    outliers = np.zeros((10, CELLS), np.bool_)
    return Fit(unknowns, x, covariance, covariance, information, residuals, outliers, Noise(0.01, 0, 0, 0), 1.0, 0.0)


def made(result: Fit) -> Calibration:
    """A calibration of such a fit."""
    nothing: Any = None
    none = np.zeros(0)
    return Calibration(
        nothing, "sun", "cosine", 20.0, nothing, result, left_of(result), None, None, None, none, None, none, none
    )


def test_the_interval_holds_the_mean_change_as_often_as_it_says():
    rng = np.random.default_rng(5)
    white = rng.normal(size=(2000, 404))
    sums = np.cumsum(white, axis=1)
    alike = sums[:, 4:] - sums[:, :-4]  # over a fifth of a stretch
    for changes, most in ((white, 0.02), (alike, 0.05)):
        outside = np.mean([abs(row.mean()) > (half_interval(row) or 0.0) for row in changes])
        assert 0.003 < outside < most


def test_few_instants_tell_no_interval():
    assert half_interval(np.zeros(24)) is None
    assert half_interval(np.zeros(25)) == 0.0


@pytest.mark.parametrize(
    ("found", "worse"),
    [
        (gain(5.0, 3.0), False),
        (gain(5.0, 5.3), False),
        (gain(5.0, 5.5), True),
        (gain(5.0, 50.0, None), False),
        # cells that were right already
        (gain(1e-9, 2e-9, 0.0), False),
    ],
)
def test_only_a_change_beyond_the_interval_is_worse(found, worse):
    result = made(linear_fit(1e4 * np.eye(8), np.zeros(8)))
    assert found.is_worse == worse == found.as_object()["worse"]
    assert len(worse_lines(result, [found])) == worse


def test_a_cell_that_is_left_out_is_named_with_its_evidence():
    result = made(linear_fit(1e4 * np.eye(8), np.zeros(8)))
    cells = [LeftOut(0, 0.0, 0.1, "any: cell.0 dead"), LeftOut(1, 0.1, 0.6, "any: cell.1 scaled, at 5 s")]
    (line,) = worse_lines(result, [gain(7.0, 9.65, left_out=cells)])
    assert "errs by 9.650 deg, by 7.000 before, beyond the interval of 0.400 deg" in line and "\n" not in line
    assert "leaves out cell 1 for 60 % of it, for 10 % before, though its outputs are 0.010 rms off" in line
    assert "(any: cell.1 scaled, at 5 s); cells 0 too" in line


def test_what_is_told_with_others_alone_is_named_where_no_cell_is_left_out():
    information = np.diag([1e4, 1.0, 1e4, 1e4, 1e4, 1e4, 1e4, 1e4])
    (line,) = worse_lines(made(linear_fit(information, np.zeros(8))), [gain(5.0, 6.0)])
    assert "told together with others alone: dark of cell 0" in line


def test_parameters_beside_one_that_is_not_told_are_what_is_told_of_them_then():
    information = 1e4 * np.eye(8)
    # a scale and a dark level of which only a sum is told: the level alone is as unknown as before
    mixed = np.array([1.0, 0.2])
    information[:2, :2] = 50.0 * np.outer(mixed, mixed)
    x = np.full(8, 0.1)
    x[:2] = 0.2, 1.0
    result = linear_fit(information, x)
    assert left_of(result)[0, 1] > 0.95 > left_of(result)[0, 0]
    kept = told(result)
    assert kept.x[1] == 0.0
    precision = information + np.eye(8)
    expected = x[0] + precision[0, 1] * x[1] / precision[0, 0]
    assert kept.x[0] == pytest.approx(expected)
    assert kept.x[2:] == pytest.approx(x[2:])


def test_where_all_is_told_nothing_changes():
    x = np.linspace(-0.5, 0.5, 8)
    assert told(linear_fit(1e4 * np.eye(8), x)).x.tolist() == x.tolist()


def test_light_that_passes_for_a_dark_level_is_told_from_it_by_those_that_are_dark_without_it():
    """Outputs away from the Sun: some in the light of an Earth, some in a shadow, where only the level is left."""
    lit = np.repeat([1.0, 0.0], 500)
    level, light, white, ignorance, most = 0.02, 0.08, 0.01, 0.1, 0.1
    jacobian = np.full((1000, 1), ignorance / white)
    patterns = np.column_stack([lit, np.zeros(1000)]) * most / white
    read = level + light * lit
    x = np.array([read.mean() / ignorance])  # of a fit that knows no light
    off = (x[0] * ignorance - read) / white
    found, covariance = _beside_earth(jacobian, patterns, off, x, 1.0)
    assert found[0] * ignorance == pytest.approx(level, abs=1e-4)
    assert np.sqrt(covariance[0, 0]) * ignorance == pytest.approx(white / np.sqrt(500), rel=0.05)
