# SPDX-License-Identifier: Apache-2.0
"""One cycle of the control as a whole, and a closed-loop flight on the true Sun."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from okeefe_spacecraft import okeefe_values
from scipy.integrate import solve_ivp

from css_common.actuator_sections import RODS, WHEELS
from css_common.attitude import mrp_rate, mrp_shadow, mrp_to_dcm
from css_common.sections import SPACECRAFT
from css_common.vectors import angle_between, multiply
from sunpoint_control import sun_pointing_control as control
from sunpoint_control.held_field import HeldField
from sunpoint_control.modes import MODE_ECLIPSE, MODE_SAFE, MODE_SUN_ACQUISITION, MODE_SUN_POINT, MODE_SUN_SEARCH

TABLE = SPACECRAFT + WHEELS + RODS + control.PARAMETERS
AXES = np.asarray(okeefe_values(WHEELS).wheels.axes)
INERTIA = np.diag((10.5, 8.0, 6.75))
DT = 0.1
NONE, HELD, VALID = 0, 1, 2
NO_RATE, GYRO = 0, 1
ZERO = (0.0, 0.0, 0.0)
AT_60_DEG = (math.sin(math.radians(60.0)), 0.0, 0.5)
OMEGA = (0.01, -0.02, 0.005)


class Cycle:
    """A control fed with samples; what a sample does not say is a valid Sun at 60 deg, with gyro."""

    def __init__(self, **changes):
        self.p = control.parameters(okeefe_values(TABLE, **changes))
        self.state = control.initial_state(self.p)
        self.memory = control.initial_memory(self.p)
        self.torques = np.full(4, np.nan)
        self.dipoles = np.full(3, np.nan)

    def step(
        self, sun_b=AT_60_DEG, validity=VALID, eclipse=0, omega=OMEGA, source=GYRO,
        speeds=(*ZERO, 0.0), field=ZERO, field_valid=False, dt=DT,
    ):  # fmt: skip
        self.state, output = control.step(
            self.p, self.state, self.memory, dt, sun_b, validity, eclipse, omega, source,
            np.array(speeds, dtype=np.float64), HeldField(field, field_valid, field_valid), self.torques, self.dipoles,
        )  # fmt: skip
        return output

    def steps(self, count, **sample):
        for _ in range(count):
            output = self.step(**sample)
        return output


def test_first_cycle_acts():
    cycle = Cycle()
    output = cycle.step()
    assert output.mode == MODE_SUN_ACQUISITION
    assert output.pointing_error == pytest.approx(math.radians(60.0))
    np.testing.assert_allclose(-AXES.T @ cycle.torques, output.torque_b, atol=1e-15)
    assert output.rate == pytest.approx(np.linalg.norm(OMEGA))
    assert np.any(output.torque_b)


def test_another_axis_is_turned_to_the_sun_as_the_array_normal_is():
    by_default, by_axis = Cycle(), Cycle(reference__axis=[0.3, -0.6, 0.6])
    there = Cycle(spacecraft__array_normal=(np.array([0.3, -0.6, 0.6]) / 0.9).tolist())
    assert by_default.p.pointing.axis_b == (0.0, 0.0, 1.0)
    turned, normal = by_axis.steps(3), there.steps(3)
    angle = angle_between(AT_60_DEG, there.p.pointing.axis_b)
    assert turned.pointing_error == pytest.approx(angle) != by_default.step().pointing_error
    np.testing.assert_allclose(turned.torque_b, normal.torque_b, rtol=1e-12)
    on_it = by_axis.steps(5, sun_b=tuple(np.array([0.3, -0.6, 0.6]) / 0.9), omega=ZERO)
    assert on_it.mode == MODE_SUN_POINT and on_it.pointing_error < 1e-7


@pytest.mark.parametrize(("behaviour", "factor"), [("zero", 0.0), ("damp", -0.9)])
def test_deadband_is_on_the_estimate(behaviour, factor):
    cycle = Cycle(deadband_behaviour=behaviour)
    outside = cycle.step(sun_b=(math.sin(math.radians(15.1)), 0.0, math.cos(math.radians(15.1))))
    inside = cycle.step(sun_b=(math.sin(math.radians(14.9)), 0.0, math.cos(math.radians(14.9))))
    assert (outside.deadband, inside.deadband) == (False, True)
    np.testing.assert_allclose(inside.torque_b, np.multiply(factor, OMEGA), rtol=1e-12)


def test_no_rate_information_coasts_whatever_the_mode():
    for sample in ({}, {"eclipse": 1, "validity": HELD}, {"validity": NONE, "sun_b": ZERO}):
        for behaviour in ("coast", "rate_damp", "hold_attitude"):
            cycle = Cycle(eclipse_behaviour=behaviour)
            for _ in range(300):
                assert cycle.step(source=NO_RATE, **sample).torque_b == ZERO
                assert not np.any(cycle.torques)


@pytest.mark.parametrize(
    ("behaviour", "expected"), [("coast", ZERO), ("rate_damp", tuple(-0.9 * w for w in OMEGA)), ("hold_attitude", None)]
)
def test_eclipse_behaviour(behaviour, expected):
    cycle = Cycle(eclipse_behaviour=behaviour)
    lit = cycle.step()
    dark = cycle.steps(4, eclipse=1, validity=HELD)
    assert dark.mode == MODE_ECLIPSE
    if expected is None:
        # the propagated Sun is still pointed at; only the integral has moved on
        np.testing.assert_allclose(dark.torque_b, lit.torque_b, rtol=1e-3)
    else:
        np.testing.assert_allclose(dark.torque_b, expected, rtol=1e-12)


def test_search_turns_about_x():
    cycle = Cycle()
    output = cycle.steps(210, validity=NONE, sun_b=ZERO, omega=ZERO)
    assert output.mode == MODE_SUN_SEARCH
    assert output.pointing_error == -1.0
    np.testing.assert_allclose(output.torque_b, (0.9 * math.radians(1.0), 0.0, 0.0), rtol=1e-12)


def test_safe_mode_rests():
    cycle = Cycle(enabled=False, dumping__enabled=True, rods__fitted=True)
    output = cycle.steps(5, speeds=(100.0, 0.0, 0.0, 0.0), field=(2e-5, 0.0, 0.0), field_valid=True)
    assert output.mode == MODE_SAFE
    assert not np.any(cycle.torques) and not np.any(cycle.dipoles)


def test_integral_is_frozen_where_it_could_wind_up():
    cycle = Cycle()
    cycle.step(omega=ZERO)
    moving = cycle.state.integral
    assert moving != ZERO
    cycle.step(sun_b=(0.0, 0.0, 1.0))  # deadband
    cycle.step(source=NO_RATE)
    cycle.step(omega=(0.3, 0.0, 0.0))  # beyond the wheels' torque
    assert cycle.state.integral == moving
    cycle.step(omega=ZERO)
    assert cycle.state.integral != moving


def test_saturation_is_reported():
    cycle = Cycle()
    assert cycle.step(omega=(0.3, 0.0, 0.0)).wheels_saturated != 0
    assert np.abs(cycle.torques).max() == pytest.approx(0.030)


def test_saturation_of_the_rods_is_reported_while_they_work():
    cycle = Cycle(dumping__enabled=True, rods__fitted=True, rods__max_dipole=0.5)
    sample = {"speeds": (600.0, -500.0, 300.0, 100.0), "field": (2e-5, 1e-5, -3e-5)}
    output = cycle.step(**sample, field_valid=True)
    assert output.dumping and output.rods_saturated != 0
    assert np.abs(cycle.dipoles).max() == pytest.approx(0.5)
    output = cycle.step(**sample, field_valid=False)
    assert not output.dumping and output.rods_saturated == 0


def test_dumping_in_the_shadow_alone():
    cycle = Cycle(dumping__enabled=True, dumping__when="eclipse", rods__fitted=True)
    sample = {"speeds": (100.0, -50.0, 30.0, 10.0), "field": (2e-5, 1e-5, -3e-5), "field_valid": True}
    assert not cycle.step(**sample).dumping
    assert not np.any(cycle.dipoles)
    for _ in range(3):
        output = cycle.step(**sample, eclipse=1)
    assert output.mode == MODE_ECLIPSE and output.dumping
    assert np.any(cycle.dipoles)


def test_dumping_adds_nothing_to_the_torque_on_the_body():
    plain, dumping = Cycle(), Cycle(dumping__enabled=True, rods__fitted=True)
    field = (1e-5, -2e-5, 3e-5)
    sample = {"speeds": (120.0, -60.0, 80.0, 10.0), "field": field, "field_valid": True, "omega": ZERO}
    sample["sun_b"] = (math.sin(0.3), 0.0, math.cos(0.3))
    assert not plain.step(**sample).dumping
    assert dumping.step(**sample).dumping
    on_body = -AXES.T @ dumping.torques + np.cross(dumping.dipoles, field)
    np.testing.assert_allclose(on_body, -AXES.T @ plain.torques, atol=1e-15)
    assert not dumping.step(**{**sample, "field_valid": False}).dumping
    assert not np.any(dumping.dipoles)


anything = st.one_of(st.floats(-1.0, 1.0), st.floats(allow_nan=True, allow_infinity=True))
vector = st.tuples(anything, anything, anything)


@settings(max_examples=150, deadline=None)
@given(
    st.lists(
        st.fixed_dictionaries(
            {
                "sun_b": vector,
                "validity": st.integers(0, 2),
                "eclipse": st.integers(0, 1),
                "omega": vector,
                "source": st.integers(0, 3),
                "speeds": st.tuples(anything, anything, anything, anything),
                "field": vector,
                "field_valid": st.booleans(),
                "dt": anything,
            }
        ),
        max_size=12,
    )
)
def test_any_input_gives_finite_commands_within_limits(samples):
    cycle = Cycle(dumping__enabled=True, rods__fitted=True)
    for sample in samples:
        output = cycle.step(**sample)
        assert np.abs(cycle.torques).max() <= 0.030 * (1.0 + 1e-12)
        assert np.abs(cycle.dipoles).max() <= 20.0 * (1.0 + 1e-12)
        numbers = (*output.torque_b, *output.integral, *output.wheel_momentum_b, output.pointing_error, output.rate)
        assert all(map(math.isfinite, numbers))


@pytest.mark.parametrize("seed", range(2))
def test_flight_on_the_true_sun_ends_on_it(seed):
    """Rates of 2 deg/s, 30 mNm wheels, true Sun and rate, no deadband: on the Sun and at rest within five minutes."""
    rng = np.random.default_rng(seed)
    cycle = Cycle(deadband_deg=0.0)
    sun_n = (0.36, 0.48, 0.8)
    sigma = mrp_shadow(tuple(rng.uniform(-0.8, 0.8, 3).tolist()))
    y = np.concatenate((sigma, np.radians(rng.uniform(-2.0, 2.0, 3)), np.zeros(4)))

    def derivative(_, y, u):
        s, w, h = y[0:3], y[3:6], AXES.T @ y[6:10]
        w_dot = np.linalg.solve(INERTIA, -np.cross(w, INERTIA @ w + h) - AXES.T @ u)
        return np.concatenate((mrp_rate(tuple(s), tuple(w)), w_dot, u))

    for _ in range(3000):
        sun_b = multiply(mrp_to_dcm(tuple(y[:3].tolist())), sun_n)
        omega = tuple(y[3:6].tolist())
        speeds = y[6:10] / 0.001 - AXES @ y[3:6]
        output = cycle.step(sun_b=sun_b, omega=omega, speeds=tuple(speeds))
        y = solve_ivp(derivative, (0.0, DT), y, args=(cycle.torques.copy(),), rtol=1e-6, max_step=DT).y[:, -1]
        y[:3] = mrp_shadow(tuple(y[:3].tolist()))
    error = angle_between(multiply(mrp_to_dcm(tuple(y[:3].tolist())), sun_n), (0.0, 0.0, 1.0))
    assert output.mode == MODE_SUN_POINT
    assert error < math.radians(0.5)
    assert np.linalg.norm(y[3:6]) < math.radians(0.005)
