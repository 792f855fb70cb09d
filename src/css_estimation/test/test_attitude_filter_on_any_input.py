# SPDX-License-Identifier: Apache-2.0
"""A filter fed nonsense stays finite, lets its covariance grow, and finds the attitude again."""

import math

import numpy as np
import pytest
from attitude_scene import SUN_N, Run, Scene, options
from hypothesis import given, settings
from hypothesis import strategies as st
from presence import present

from css_estimation.attitude.attitude_solution import (
    MODE_LOST,
    MODE_PROPAGATING,
    MODE_STARTED,
    MODE_TRACKING,
    MODE_WAITING,
    VALIDITY_HELD,
    VALIDITY_NONE,
    VALIDITY_VALID,
)
from css_estimation.attitude.flight_references import References

MODELS = pytest.mark.parametrize("model", ["vector", "voltage"])


def settled(model, seed=1, **changes):
    scene, run = Scene(seed), Run(options(sun_model=model, **changes))
    fly(scene, run, 200)
    assert run.error_deg(scene) < 2.0
    return scene, run


def fly(scene, run, steps, **given):
    for _ in range(steps):
        run.step(scene, **given)
        scene.advance()
    run.step(scene, 0.0, **given)


number = st.floats(allow_nan=True, allow_infinity=True)
reading = st.one_of(st.floats(-0.1, 1.2), number)
vector = st.tuples(*[st.one_of(st.floats(-0.1, 0.1), number)] * 3)
field = st.tuples(*[st.one_of(st.floats(-5e-5, 5e-5), number)] * 3)
lit = st.booleans()
cycle = st.tuples(
    st.lists(reading, min_size=6, max_size=6),
    vector,
    field,
    st.one_of(st.sampled_from([1.0, 0.0, 0.1, 9.0, 3600.0]), number),
    lit,
    lit,
)


@pytest.mark.parametrize("changes", [{}, {"calibration__mode": "estimate", "calibration__alignment": True}])
@settings(max_examples=60, deadline=None)
@given(cycles=st.lists(cycle, min_size=1, max_size=15))
def test_any_sequence(changes, cycles):
    run = Run(options(sun_model="voltage", **changes))
    scene = Scene(3)
    fly(scene, run, 5)
    for voltages, gyro, field_b, dt, sunlit, valid in cycles:
        run.step(scene, dt, voltages=np.array(voltages), gyro=gyro, field=field_b, sunlit=sunlit, valid=valid)


@MODELS
def test_nan_in_everything_is_no_measurement(model):
    scene, run = settled(model)
    before = run.sigma_deg
    for _ in range(100):
        run.step(scene, voltages=np.full(6, math.nan), gyro=(math.nan,) * 3, field=(math.nan,) * 3)
        scene.advance()
    assert run.solution.validity == VALIDITY_HELD and run.solution.mode == MODE_PROPAGATING
    assert run.sigma_deg > 3.0 * before and run.solution.age > 99.0
    fly(scene, run, 100)
    assert run.solution.validity == VALIDITY_VALID and run.error_deg(scene) < 2.0


@MODELS
def test_a_step_too_long_loses_the_attitude_until_sun_and_field_give_it_again(model):
    scene, run = settled(model)
    scene.advance(500.0)
    dark = np.zeros(6)
    run.step(scene, 500.0, voltages=dark)
    assert run.solution.mode == MODE_LOST and run.solution.validity == VALIDITY_HELD
    assert run.sigma_deg > 150.0
    fly(scene, run, 60)
    assert run.solution.mode == MODE_TRACKING and run.error_deg(scene) < 2.0


@MODELS
def test_an_orbit_of_dark_cells(model):
    """Sunlit by the orbit model, every cell dark: the field and the gyro carry the attitude on."""
    scene, run = settled(model)
    before = run.sigma_deg
    fly(scene, run, 5550, voltages=np.zeros(6))
    assert run.sigma_deg > before and run.error_deg(scene) < 5.0
    fly(scene, run, 60)
    assert run.error_deg(scene) < 2.0


@MODELS
def test_darkness_without_field(model):
    scene, run = settled(model)
    before = run.sigma_deg
    fly(scene, run, 1500, sunlit=False, field=(0.0, 0.0, 0.0))
    assert run.solution.mode == MODE_PROPAGATING
    # the angle random walk alone gives 0.03 deg sqrt(3 x 1500)
    assert run.sigma_deg > max(before, 2.0)
    assert run.error_deg(scene) < 4.0 * run.sigma_deg
    fly(scene, run, 60)
    assert run.error_deg(scene) < 2.0


def along_sun(scene):
    return References(SUN_N, 1.0, True, tuple(4e-5 * np.array(SUN_N)))


@MODELS
def test_no_start_from_a_field_along_the_sun(model):
    scene, run = Scene(2), Run(options(sun_model=model))
    for _ in range(50):
        run.step(scene, references=along_sun(scene), field=tuple(4e-5 * scene.sun_b))
        scene.advance()
        assert present(run.solution).mode == MODE_WAITING and present(run.solution).validity == VALIDITY_NONE
    fly(scene, run, 60)
    assert run.error_deg(scene) < 2.0


@MODELS
def test_a_field_along_the_sun_lets_the_angle_about_both_grow(model):
    scene, run = settled(model)
    before = run.sigma_deg
    for _ in range(1500):
        run.step(scene, references=along_sun(scene), field=tuple(4e-5 * scene.sun_b + 2e-7 * scene.rng.normal(size=3)))
        scene.advance()
    assert run.sigma_deg > 3.0 * before
    fly(scene, run, 60)
    assert run.error_deg(scene) < 2.0


@MODELS
def test_a_wrong_attitude_is_given_up(model):
    """Converged, then turned behind the filter's back: all it sees contradicts it, and it starts anew."""
    scene, run = settled(model)
    x, y, z = run.state.sigma_bn
    run.state = run.state._replace(sigma_bn=(-x, y, -z), bias_b=(0.05, 0.0, 0.0))
    fly(scene, run, 200)
    assert run.error_deg(scene) < 2.0
    assert np.degrees(np.linalg.norm(np.subtract(run.solution.bias_b, scene.bias))) < 0.05


@MODELS
def test_a_field_that_stands_still_does_not_carry_the_attitude_away(model):
    scene, run = settled(model)
    stuck = scene.field()
    modes = []
    for _ in range(400):
        run.step(scene, field=stuck)
        scene.advance()
        modes.append(run.solution.mode)
    assert modes.count(MODE_STARTED) < 20
    fly(scene, run, 150)
    assert run.error_deg(scene) < 2.0


@MODELS
def test_without_gyro_the_last_rate_is_held_and_the_filter_knows_less(model):
    scene, run = settled(model)
    before = run.sigma_deg
    for _ in range(20):
        run.step(scene, gyro=(math.nan,) * 3)
        scene.advance()
    assert run.sigma_deg > before
    fly(scene, run, 100)
    assert run.error_deg(scene) < 2.0
