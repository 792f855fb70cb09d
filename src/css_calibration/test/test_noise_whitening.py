# SPDX-License-Identifier: Apache-2.0
"""Whitened outputs give what the whole covariance of their errors gives, by dense algebra."""

import numpy as np
import pytest

from css_calibration.noise_whitening import Errors

CELLS, INSTANTS = 3, 12


@pytest.fixture
def errors() -> Errors:
    random = np.random.default_rng(4)
    instant, cell = np.nonzero(random.random((INSTANTS, CELLS)) < 0.7)
    count = len(instant)
    kept = random.uniform(0.3, 1.0, INSTANTS)
    own, common, cloudy = random.uniform(0.5, 2.0, (3, count))
    return Errors(instant, cell, kept, own, common * (cell != 1), cloudy)


def dense(e: Errors) -> np.ndarray:
    """(K, K) covariance of the outputs."""
    kept = np.cumprod(np.append(1.0, e.kept[1:]))
    first, last = np.minimum.outer(e.instant, e.instant), np.maximum.outer(e.instant, e.instant)
    clouds = np.equal.outer(e.cell, e.cell) * kept[last] / kept[first]
    together = np.equal.outer(e.instant, e.instant)
    return np.diag(e.own) + together * np.outer(e.common, e.common) + clouds * np.outer(e.cloudy, e.cloudy)


def test_products_are_those_with_the_inverse_of_the_covariance(errors):
    values = np.random.default_rng(5).normal(size=(len(errors.cell), 4))
    white = errors.whitened(values)
    assert white.T @ white == pytest.approx(values.T @ np.linalg.solve(dense(errors), values), rel=1e-9)


def test_drawn_errors_come_out_white(errors):
    drawn = np.linalg.cholesky(dense(errors)) @ np.random.default_rng(6).normal(size=(len(errors.cell), 4000))
    white = errors.whitened(drawn)
    found = white @ white.T / 4000
    assert np.abs(found - np.eye(len(found))).max() < 6.0 / np.sqrt(4000)


def test_what_has_no_error_in_common_is_divided_by_its_own(errors):
    errors.common[:] = errors.cloudy[:] = 0.0
    values = np.arange(1.0, len(errors.cell) + 1.0)[:, None]
    assert errors.whitened(values)[:, 0] == pytest.approx(values[:, 0] / np.sqrt(errors.own))
    assert values[0, 0] == 1.0
