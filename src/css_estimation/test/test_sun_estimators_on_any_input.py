# SPDX-License-Identifier: Apache-2.0
"""Whatever comes in, what goes out is finite, and the heading is a unit vector or none."""

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from listing import components, executable, settings_of
from okeefe_spacecraft import okeefe_values

from css_common.matrices import IDENTITY
from css_environment.earth_light import albedo_sources, new_earth_view, new_light
from css_estimation.sun.cell_layout import READABLE
from css_estimation.sun.sun_estimator import SunEstimator
from css_estimation.sun.sun_heading import (
    PREDICTION_SUNLIT,
    UNAIDED,
    UNKNOWN_SKY,
    VALIDITY_HELD,
    VALIDITY_NONE,
    VALIDITY_VALID,
)
from css_estimation.sun_filter import sun_filter

KINDS = components(base=SunEstimator)
TURNING = UNAIDED._replace(gyro_b=(0.0, 0.0, 0.01), gyro_valid=True)
SUN_B = (0.0, 0.6, 0.8)


def variants():
    """Every estimator as it is by default, and with each of its flags and choices in each other way."""
    for kind in KINDS:
        yield pytest.param(kind, {}, id=executable(kind))
        for parameter in kind.parameters:
            others = {"flag": (not parameter.default,), "choice": parameter.choices}.get(parameter.kind, ())
            for other in others:
                if other != parameter.default:
                    changes = {parameter.name.replace(".", "__"): other}
                    yield pytest.param(kind, changes, id=f"{executable(kind)} {parameter.name}={other}")


def random_normals(count):
    n = np.random.default_rng(count).normal(size=(count, 3))
    return (n / np.linalg.norm(n, axis=1, keepdims=True)).ravel().tolist()


@cache
def layouts(kind: Any):
    """Cells by their number: at random, or those of its mission where it takes no others."""
    drawn = {count: {"cells__normals": random_normals(count)} for count in (1, 2, 8, 32)}
    if any(kind.conflicts(okeefe_values(kind.table(), **layout)) for layout in drawn.values()):
        layout = settings_of(kind, "cells", "spacecraft")
        drawn = {len(layout["cells__normals"]) // 3: layout}
    return {count: {"cells__clip_normal": [0.0, 0.0, 0.0]} | layout for count, layout in drawn.items()}


ALL = list(variants())
DEFAULTS = [variant for variant in ALL if not variant.values[1]]
VARIANTS = pytest.mark.parametrize(("kind", "options"), ALL)
BY_COUNT = pytest.mark.parametrize(
    ("kind", "options", "count"),
    [
        pytest.param(*variant.values, count, id=f"{variant.id} of {count}")
        for variant in ALL
        for count in (layouts(variant.values[0]) if variant in DEFAULTS else [max(layouts(variant.values[0]))])
    ],
)


def build(kind, count, **changes):
    p = kind.algorithm.parameters(okeefe_values(kind.table(), **(layouts(kind)[count] | changes)))
    return p, kind.algorithm.initial_state(p), kind.algorithm.initial_memory(p)


def predicting(predicted, aiding=UNAIDED):
    """What is known beside the cells, with what an orbit model says about the shadow."""
    return aiding._replace(sky=aiding.sky._replace(predicted=predicted))


def earth_below():
    """Light of the Earth 400 km below, at noon, in a frame whose x axis is the Sun's direction and up."""
    light, grid = new_light(), np.full((36, 72), 0.3)
    albedo_sources(new_earth_view(), (6.778e6, 0.0, 0.0), (1.0, 0.0, 0.0), 1.0, IDENTITY, grid, light)
    return light


def largest_believed(kind):
    """Output that an estimator still takes for one."""
    return 1e3 if kind.algorithm is sun_filter else READABLE


def outputs_of(kind, count, sun_b):
    normals = np.reshape(layouts(kind)[count]["cells__normals"], (-1, 3))
    return np.maximum(normals @ sun_b, 0.0)


def assert_sane(heading, largest_variance=4.0):
    numbers = (*heading.sun_b, *heading.covariance, *heading.omega_bn_b, heading.age, heading.nis)
    assert all(map(math.isfinite, numbers))
    length = math.sqrt(sum(c * c for c in heading.sun_b))
    assert abs(length - 1.0) < 1e-9 or (length == 0.0 and heading.validity == VALIDITY_NONE)
    assert heading.age >= 0.0 and heading.nis >= 0.0
    assert heading.lit_mask.bit_count() >= heading.nis_dof
    if heading.covariance[0] != -1.0:
        p = np.array(heading.covariance).reshape(3, 3)
        assert np.array_equal(p, p.T)
        assert np.linalg.eigvalsh(p).min() > -1e-12
        assert np.diag(p).max() <= largest_variance + 1e-9


outputs = st.one_of(
    st.just(0.0), st.floats(-0.1, 1.2), st.floats(allow_nan=True, allow_infinity=True), st.sampled_from([0.5, 1.0])
)
rates = st.one_of(st.floats(-0.2, 0.2), st.floats(allow_nan=True, allow_infinity=True))
fields = st.one_of(st.floats(-6e-5, 6e-5), st.floats(allow_nan=True, allow_infinity=True))
aidings = st.builds(
    UNAIDED._replace,
    gyro_b=st.tuples(rates, rates, rates),
    gyro_valid=st.booleans(),
    field_b=st.tuples(fields, fields, fields),
    field_valid=st.booleans(),
    wheel_speeds=st.builds(np.array, st.lists(rates, min_size=4, max_size=4)),
    wheels_valid=st.booleans(),
    sky=st.builds(
        UNKNOWN_SKY._replace,
        known=st.booleans(),
        illumination=st.sampled_from([0.0, 0.5, 1.0]),
        light=st.sampled_from([UNKNOWN_SKY.light, earth_below()]),
    ),
)
times = st.one_of(st.sampled_from([0.1, 0.0, 1e-9, 1.0, 3600.0]), st.floats(allow_nan=True, allow_infinity=True))


@cache
def cycles_of(count):
    """A few cycles with so many cells."""
    voltages = st.lists(outputs, min_size=count, max_size=count)
    return st.lists(st.tuples(voltages, aidings, times, st.sampled_from([-1, 0, 1])), min_size=1, max_size=12)


@VARIANTS
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_any_sequence(kind, options, data):
    count = data.draw(st.sampled_from(sorted(layouts(kind))), "cells")
    drawn = {"eclipse__source": "both"}
    if any(parameter.name == "rate.use_field" for parameter in kind.parameters):
        drawn["rate__use_field"] = data.draw(st.booleans(), "use_field")
    p, state, memory = build(kind, count, **(drawn | options))
    for voltages, aiding, dt, predicted in data.draw(cycles_of(count), "cycles"):
        state, heading = kind.algorithm.step(p, state, memory, dt, np.array(voltages), predicting(predicted, aiding))
        assert_sane(heading)


@pytest.mark.parametrize("kind", KINDS, ids=executable)
@settings(max_examples=100, deadline=None)
@given(data=st.data())
def test_any_sequence_with_parameters_at_the_ends_of_their_ranges(kind, data):
    count = data.draw(st.sampled_from(sorted(layouts(kind))), "cells")
    ends = {}
    for parameter in kind.parameters:
        if parameter.kind == "real":
            low = None if parameter.open_low else parameter.low
            known = [end for end in (parameter.default, low, parameter.high) if end is not None]
            ends[parameter.name.replace(".", "__")] = st.sampled_from(known)
    p, state, memory = build(kind, count, **data.draw(st.fixed_dictionaries(ends), "parameters"))
    for voltages, aiding, dt, predicted in data.draw(cycles_of(count), "cycles"):
        state, heading = kind.algorithm.step(p, state, memory, dt, np.array(voltages), predicting(predicted, aiding))
        assert_sane(heading, largest_variance=100.0)


@pytest.mark.parametrize("dt", [5e-324, 1e-300, 1e-31, 1e-13])
@pytest.mark.parametrize("kind", KINDS, ids=executable)
def test_no_rate_is_divided_by_a_step_of_next_to_no_time(kind, dt):
    """Stamps are whole nanoseconds; of a shorter step the quotients overflow, and infinity times zero is no number."""
    count = max(layouts(kind))
    with_field = any(parameter.name == "rate.use_field" for parameter in kind.parameters)
    p, state, memory = build(kind, count, **({"rate__use_field": True} if with_field else {}))
    measured = UNAIDED._replace(field_b=(3e-5, -1e-5, 0.0), field_valid=True)
    for angle, step in ((0.0, 0.1), (0.001, 0.1), (0.002, dt), (0.003, dt), (0.004, 0.1)):
        sun_b = (0.0, math.sin(0.6 + angle), math.cos(0.6 + angle))
        outputs_now = outputs_of(kind, count, sun_b)
        state, heading = kind.algorithm.step(
            p, state, memory, step, outputs_now, predicting(PREDICTION_SUNLIT, measured)
        )
        assert_sane(heading)


@BY_COUNT
@pytest.mark.parametrize("level", [0.0, 1e-300, 0.5, 1.0, 1e30, 1e90, 1e200])
def test_all_outputs_equal(kind, options, count, level):
    p, state, memory = build(kind, count, **options)
    for _ in range(50):
        state, heading = kind.algorithm.step(
            p, state, memory, 0.1, np.full(count, level), predicting(PREDICTION_SUNLIT, TURNING)
        )
        assert_sane(heading)
    # no Sun lights all cells alike: a filter that notices holds what it had
    accepted = (VALIDITY_HELD, VALIDITY_VALID) if kind.algorithm is sun_filter else (VALIDITY_VALID,)
    assert (heading.validity in accepted) == (0.5 <= level < largest_believed(kind))


@VARIANTS
def test_one_dead_reading_costs_one_cell(kind, options):
    """A NaN is a dark cell: the heading comes from the others."""
    count = next(n for n in (8, *layouts(kind)) if n in layouts(kind))
    p, state, memory = build(kind, count, **options)
    voltages = outputs_of(kind, count, SUN_B)
    voltages[np.argmin(voltages)] = math.nan
    for _ in range(100):
        state, heading = kind.algorithm.step(p, state, memory, 0.1, voltages, predicting(PREDICTION_SUNLIT))
    assert heading.validity == VALIDITY_VALID
    assert_sane(heading)
    assert np.dot(heading.sun_b, SUN_B) > math.cos(math.radians(60.0))


@pytest.mark.parametrize("kind", KINDS, ids=executable)
def test_cells_are_left_out_one_by_one(kind):
    """A cell that is missing (NaN), or brighter than Sun and Earth can make it, costs itself and nothing else."""
    count = next(n for n in (8, *layouts(kind)) if n in layouts(kind))
    normals = np.reshape(layouts(kind)[count]["cells__normals"], (-1, 3))
    for i in range(count):
        came_to = {}
        for fault in (math.nan, 2.5, 16.0, math.inf):
            p, state, memory = build(kind, count, cells__field_of_view_deg=180.0)
            voltages = np.maximum(normals @ SUN_B, 0.0)
            voltages[i] = fault
            for _ in range(60):
                state, heading = kind.algorithm.step(p, state, memory, 0.1, voltages, predicting(PREDICTION_SUNLIT))
            assert_sane(heading)
            assert heading.lit_mask >> i & 1 == 0, f"cell {i} at {fault}"
            assert heading.validity == VALIDITY_VALID, f"cell {i} at {fault}"
            came_to[fault] = heading.sun_b
        # the Sun filter has its own bounds: what it does not take for a reading it may still look at, to refuse it
        for fault in came_to if kind.algorithm is not sun_filter else ():
            assert came_to[fault] == came_to[math.nan], f"cell {i} at {fault}"


def takes(kind: Any, count: int) -> bool:
    return count in layouts(kind)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if takes(kind, 32)], ids=executable)
def test_32_cells_use_the_whole_mask(kind):
    p, state, memory = build(kind, 32)
    _, heading = kind.algorithm.step(p, state, memory, 0.1, np.ones(32), UNAIDED)
    assert heading.lit_mask == 2**32 - 1
