# SPDX-License-Identifier: Apache-2.0
"""Wheels and tachometers that fail in a closed loop: named, left out or mended, and used again; others are not."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from wheel_scene import AXES, LIMIT, NO_RATE, RPM, SUN_RATE, Scene

from css_common import health
from css_common.health import SORT_TACHOMETER
from sunpoint_control.modes import MODE_SAFE, MODE_SUN_POINT, REASON_FAULT
from sunpoint_control.wheel_tracks import HEALTHY, ISOLATED, MENDED, UNREAD

BEGIN = 4.0
RNG = np.random.default_rng(7)


def from_begin(fault):
    """A fault that begins while the body is turned to the Sun."""
    return lambda value, *rest: fault(value) if rest[-1] >= BEGIN else value


MOTORS = {
    "dead": (from_begin(lambda u: 0.0), health.KIND_DEAD, ISOLATED),
    "sign": (from_begin(lambda u: -u), health.KIND_SIGN, MENDED),
    "scaled": (from_begin(lambda u: 0.3 * u), health.KIND_SCALED, MENDED),
    "twice": (from_begin(lambda u: 2.0 * u), health.KIND_SCALED, MENDED),
    "stuck": (from_begin(lambda u: 0.006), health.KIND_STUCK, ISOLATED),
    "friction": (None, health.KIND_FRICTION, ISOLATED),
    "noisy": (from_begin(lambda u: u + 0.02 * RNG.standard_normal()), health.KIND_NOISY, ISOLATED),
}


@pytest.mark.parametrize("wheel", range(4))
@pytest.mark.parametrize("name", MOTORS)
def test_a_wheel_that_fails_is_named_and_the_sun_is_reached_without_it(name, wheel):
    motor, kind, state = MOTORS[name]
    scene = Scene(seed=wheel, deadband_deg=0.0)
    if motor is None:
        scene.wear[wheel] = lambda t: 0.012 if t >= BEGIN else 0.0
    else:
        scene.motor[wheel] = motor
    output = scene.turn_away_and_back()
    assert scene.held() == {wheel: kind}
    assert scene.held(SORT_TACHOMETER) == {}
    assert scene.memory.tracks["state"].tolist() == [state if i == wheel else HEALTHY for i in range(4)]
    assert output.wheels_isolated == (1 << wheel if state == ISOLATED else 0)
    assert output.mode == MODE_SUN_POINT and scene.error_deg < 3.0
    if state == MENDED:
        gain = {"sign": -1.0, "scaled": 0.3, "twice": 2.0}[name]
        assert scene.memory.tracks["gain"][wheel] == pytest.approx(gain, rel=0.1)


def offset(x):
    return x + 60.0


TACHOMETERS = {
    "dead": (from_begin(lambda w: 0.0), health.KIND_DEAD),
    "stuck": (from_begin(lambda w: 90.0), health.KIND_STUCK),
    "noisy": (from_begin(lambda w: w + 12.0 * RPM * RNG.standard_normal()), health.KIND_NOISY),
    "scaled": (from_begin(lambda w: 1.5 * w), health.KIND_SCALED),
    "sign": (from_begin(lambda w: -w), health.KIND_SIGN),
    "bias": (from_begin(offset), health.KIND_BIAS),
    "drifting": (lambda w, t: w + 8.0 * max(t - BEGIN, 0.0), health.KIND_DRIFTING),
    "spikes": (from_begin(lambda w: w + 50.0 * (RNG.random() < 0.05)), health.KIND_SPIKES),
}


@pytest.mark.parametrize("name", TACHOMETERS)
def test_a_tachometer_that_errs_is_told_from_its_wheel(name):
    reading, kind = TACHOMETERS[name]
    scene = Scene(seed=2, deadband_deg=0.0)
    scene.reading[0] = reading
    output = scene.turn_away_and_back()
    assert scene.held() == {} and output.wheels_isolated == 0
    assert scene.held(SORT_TACHOMETER) == {0: kind}
    assert scene.memory.tracks["state"].tolist() == [UNREAD, HEALTHY, HEALTHY, HEALTHY]
    assert scene.error_deg < 3.0
    if kind != health.KIND_DRIFTING:  # which has led astray before it was found
        # the speed is counted from what the wheel was commanded
        assert scene.memory.speeds[0] == pytest.approx(scene.speeds[0], abs=8.0)


def test_without_a_gyro_the_wheel_is_left_out_for_its_tachometer():
    scene = Scene(seed=2, deadband_deg=0.0, source=SUN_RATE)
    scene.reading[0] = lambda w, t: 0.0
    scene.turn_away_and_back()
    assert scene.held() == {0: health.KIND_DEAD}
    assert scene.error_deg < 5.0
    scene = Scene(seed=2, deadband_deg=0.0, source=SUN_RATE)
    scene.motor[1] = from_begin(lambda u: -u)
    scene.fly(120.0)
    assert scene.held() == {1: health.KIND_SIGN}
    assert scene.memory.tracks["state"][1] == ISOLATED  # a sign that nothing else confirms is not trusted


@pytest.mark.parametrize("seed", range(3))
def test_ordinary_wheels_are_never_held_for_failed(seed):
    scene = Scene(seed=seed, deadband_deg=0.0)
    scene.friction[:] = scene.rng.uniform(0.0, 0.2, 4) * LIMIT
    scene.noise = 2.5 * RPM
    scene.motor = {i: lambda u, *_, factor=1.0 + e: factor * u for i, e in enumerate(scene.rng.uniform(-0.1, 0.1, 4))}
    scene.fly(600.0)
    assert scene.told == []


def test_what_rests_is_not_judged():
    scene = Scene(rate_deg_s=0.0, source=NO_RATE)
    scene.motor = {i: lambda u, *_: 0.0 for i in range(4)}
    output = scene.fly(120.0)
    assert scene.told == [] and output.wheels_isolated == 0


@pytest.mark.parametrize("what", ["reading", "motor"])
def test_one_sample_is_not_enough(what):
    scene = Scene(seed=1, deadband_deg=0.0)
    if what == "reading":
        scene.reading[2] = lambda w, t: w + 400.0 if abs(t - 5.0) < 0.05 else w
    else:
        scene.motor[2] = lambda u, w, t: -LIMIT if abs(t - 5.0) < 0.05 else u
    scene.fly(60.0)
    assert scene.told == []


@pytest.mark.parametrize(("name", "end"), [("dead", 60.0), ("stuck", 30.0), ("sign", 60.0)])
def test_a_wheel_that_recovers_is_used_again(name, end):
    scene = Scene(seed=3, deadband_deg=0.0)
    motor = MOTORS[name][0]
    scene.motor[1] = lambda u, w, t: motor(u, w, t) if t < end else u
    scene.fly(end)
    assert list(scene.held()) == [1]
    if name == "sign":
        # commanded the other way round it is found out when it is next turned
        scene.sigma = (0.5, -0.3, 0.2)
    output = scene.fly(600.0)
    assert scene.held() == {} and output.wheels_isolated == 0
    assert scene.memory.tracks["gain"][1] == 1.0
    assert scene.error_deg < 3.0


def test_trials_leave_nothing_in_the_body():
    scene = Scene(seed=3, rate_deg_s=0.0, rate_noise_deg_s=0.0)
    scene.sigma = (0.0, 0.0, 0.0)
    scene.p = scene.p._replace(pointing=scene.p.pointing._replace(axis_b=scene.sun_b, deadband=3.0))
    scene.memory.tracks["state"][2] = ISOLATED
    scene.memory.tracks["passed"][2] = -1000
    largest = 0.0
    for _ in range(200):
        scene.cycle()
        largest = max(largest, float(np.linalg.norm(scene.omega)))
    # the largest torque for a window of a second about the axis of least inertia, and back
    assert 0.5 * LIMIT / 10.5 < largest < 1.1 * LIMIT / 6.75
    after = np.linalg.norm(scene.omega)
    assert after < largest


def test_a_stuck_wheel_is_countered_by_the_others():
    scene = Scene(seed=5, deadband_deg=0.0)
    scene.fly(200.0)
    scene.motor[2] = lambda u, *_: 0.006
    scene.fly(70.0)
    assert scene.held() == {2: health.KIND_STUCK}
    on_body = -AXES.T @ np.where(np.arange(4) == 2, 0.006, scene.torques)
    assert np.linalg.norm(on_body) < 0.3 * 0.006
    assert scene.error_deg < 2.0


def test_two_wheels_point_and_one_does_not_try():
    scene = Scene(seed=4, deadband_deg=0.0)
    scene.motor = dict.fromkeys((0, 1), lambda u, *_: 0.0)
    output = scene.fly(400.0)
    # wheels 2 and 3 span the plane across the array normal
    assert output.wheels_isolated == 0b0011 and output.mode == MODE_SUN_POINT and scene.error_deg < 5.0
    scene.motor[2] = lambda u, *_: 0.0
    scene.sigma = (0.4, -0.3, 0.1)
    for _ in range(4000):
        output = scene.cycle()
        if output.wheels_isolated == 0b0111:
            break
    for _ in range(3):
        output = scene.cycle()
    assert (output.mode, output.reason) == (MODE_SAFE, REASON_FAULT)
    # they recover: nothing has to be commanded for that
    scene.motor = {}
    for _ in range(20_000):
        output = scene.cycle()
        if output.mode == MODE_SUN_POINT and output.wheels_isolated == 0:
            break
    assert scene.held() == {} and output.mode == MODE_SUN_POINT


def test_switched_off_it_finds_nothing():
    scene = Scene(health__enabled=False)
    scene.motor[0] = lambda u, *_: 0.0
    scene.fly(60.0)
    assert scene.told == [] and not np.any(scene.memory.tracks["command"])


def test_no_number_begins_a_window_anew():
    scene = Scene(seed=1, deadband_deg=0.0)
    scene.reading[3] = lambda w, t: math.nan if round(t / 0.1) % 7 == 0 else w
    scene.fly(60.0)
    assert scene.told == []


anything = st.one_of(st.floats(-700.0, 700.0), st.floats(allow_nan=True, allow_infinity=True))


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(anything, anything, anything, anything, st.booleans()), min_size=20, max_size=80))
def test_any_speeds_give_finite_commands_and_known_verdicts(samples):
    scene = Scene(seed=0)
    for *speeds, gyro in samples:
        scene.source = 1 if gyro else 2
        scene.reading = {i: lambda w, t, value=value: value for i, value in enumerate(speeds)}
        scene.cycle()
        assert np.abs(scene.torques).max() <= LIMIT * (1.0 + 1e-12)
        assert all(np.isfinite(scene.memory.tracks[name]).all() for name in ("model", "gain", "odds", "drag", "offset"))
        assert set(scene.held().values()) <= {*range(20), health.KIND_UNKNOWN}
