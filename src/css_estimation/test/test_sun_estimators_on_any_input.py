# SPDX-License-Identifier: Apache-2.0
"""Whatever comes in, what goes out is finite, and the heading is a unit vector or none."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from okeefe_spacecraft import okeefe_values

from css_common.sections import CELLS
from css_estimation.sun import least_squares, sunline_ekf, wavg
from css_estimation.sun.sun_heading import UNAIDED, VALIDITY_NONE, VALIDITY_VALID, Aiding

ESTIMATORS = pytest.mark.parametrize(
    ("estimator", "options"),
    [(wavg, {}), (least_squares, {}), (least_squares, {"use_dark_cells": True}), (sunline_ekf, {})],
    ids=["wavg", "wls", "wls with dark cells", "ekf"],
)
TURNING = UNAIDED._replace(gyro_b=(0.0, 0.0, 0.01), gyro_valid=True)
rng = np.random.default_rng(7)


def normals(count):
    n = rng.normal(size=(count, 3))
    return (n / np.linalg.norm(n, axis=1, keepdims=True)).ravel().tolist()


LAYOUTS = {count: normals(count) for count in (1, 2, 8, 32)}


def build(estimator, count, **changes):
    changes.setdefault("cells__clip_normal", [0.0, 0.0, 0.0])
    p = estimator.parameters(okeefe_values(CELLS + estimator.PARAMETERS, cells__normals=LAYOUTS[count], **changes))
    return p, estimator.initial_state(p)


def assert_sane(heading):
    numbers = (*heading.sun_b, *heading.covariance, *heading.omega_bn_b, heading.age, heading.nis)
    assert all(map(math.isfinite, numbers))
    length = math.sqrt(sum(c * c for c in heading.sun_b))
    assert length == 0.0 if heading.validity == VALIDITY_NONE else abs(length - 1.0) < 1e-9
    assert heading.age >= 0.0 and heading.nis >= 0.0
    assert heading.lit_mask.bit_count() >= heading.nis_dof
    if heading.covariance[0] != -1.0:
        p = np.array(heading.covariance).reshape(3, 3)
        assert np.array_equal(p, p.T)
        assert np.linalg.eigvalsh(p).min() > -1e-12
        assert np.diag(p).max() <= 4.0 + 1e-9


outputs = st.one_of(
    st.just(0.0), st.floats(-0.1, 1.2), st.floats(allow_nan=True, allow_infinity=True), st.sampled_from([0.5, 1.0])
)
rates = st.one_of(st.floats(-0.2, 0.2), st.floats(allow_nan=True, allow_infinity=True))
fields = st.one_of(st.floats(-6e-5, 6e-5), st.floats(allow_nan=True, allow_infinity=True))
cycle = st.tuples(
    st.lists(outputs, min_size=32, max_size=32),
    st.builds(
        Aiding,
        st.tuples(rates, rates, rates),
        st.booleans(),
        st.tuples(fields, fields, fields),
        st.booleans(),
    ),
    st.one_of(st.sampled_from([0.1, 0.0, 1e-9, 1.0, 3600.0]), st.floats(allow_nan=True, allow_infinity=True)),
    st.sampled_from([-1, 0, 1]),
)


@ESTIMATORS
@settings(max_examples=150, deadline=None)
@given(cycles=st.lists(cycle, min_size=1, max_size=12), count=st.sampled_from([1, 2, 8, 32]), use_field=st.booleans())
def test_any_sequence(estimator, options, cycles, count, use_field):
    p, state = build(estimator, count, eclipse__source="both", rate__use_field=use_field, **options)
    for voltages, aiding, dt, predicted in cycles:
        state, heading = estimator.step(p, state, dt, np.array(voltages[:count]), aiding, predicted)
        assert_sane(heading)


@ESTIMATORS
@pytest.mark.parametrize("count", [1, 2, 8, 32])
@pytest.mark.parametrize("level", [0.0, 1e-300, 0.5, 1.0, 1e30, 1e90, 1e200])
def test_all_outputs_equal(estimator, options, count, level):
    p, state = build(estimator, count, **options)
    for _ in range(50):
        state, heading = estimator.step(p, state, 0.1, np.full(count, level), TURNING, -1)
        assert_sane(heading)
    assert (heading.validity == VALIDITY_VALID) == (0.5 <= level < 1e100)


@ESTIMATORS
def test_one_dead_reading_costs_one_cell(estimator, options):
    """A NaN is a dark cell: the heading comes from the others."""
    p, state = build(estimator, 8, **options)
    voltages = np.maximum(np.array(LAYOUTS[8]).reshape(8, 3) @ (0.0, 0.6, 0.8), 0.0)
    voltages[np.argmin(voltages)] = math.nan
    for _ in range(100):
        state, heading = estimator.step(p, state, 0.1, voltages, UNAIDED, -1)
    assert heading.validity == VALIDITY_VALID
    assert_sane(heading)
    assert np.dot(heading.sun_b, (0.0, 0.6, 0.8)) > math.cos(math.radians(60.0))


@ESTIMATORS
def test_32_cells_use_the_whole_mask(estimator, options):
    p, state = build(estimator, 32, **options)
    _, heading = estimator.step(p, state, 0.1, np.ones(32), UNAIDED, -1)
    assert heading.lit_mask == 2**32 - 1
