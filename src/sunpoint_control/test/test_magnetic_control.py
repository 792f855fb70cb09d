# SPDX-License-Identifier: Apache-2.0
"""One cycle of the control with torque rods alone: modes, limits, rests, and inputs that are none."""

import math

import numpy as np
import pytest
from cubesat import control_values
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from sunpoint_control import magnetic_control as control
from sunpoint_control.held_field import HeldField
from sunpoint_control.modes import MODE_DETUMBLE, MODE_ECLIPSE, MODE_SAFE, MODE_SUN_ACQUISITION, MODE_SUN_POINT

NONE, HELD, VALID = 0, 1, 2
NO_RATE, GYRO, FIELD = 0, 1, 3
ZERO = (0.0, 0.0, 0.0)
NAN = (math.nan, 0.0, 0.0)
FIELD_N = np.array([1e-5, 3e-5, -2e-5])
X, ACROSS = (1.0, 0.0, 0.0), (0.0, 0.6, 0.8)


class Cycle:
    """A control fed with samples of a body that turns evenly; a sample says that the Sun stands across."""

    def __init__(self, *overrides, omega=(0.0, 0.05, 0.0)):
        self.values = control_values(*overrides)
        self.p = control.parameters(self.values)
        self.state = control.initial_state(self.p)
        self.memory = control.initial_memory(self.p)
        self.omega, self.count = omega, 0
        self.divider = int(self.values.magnetometer.divider)
        self.dipoles = np.full(3, np.nan)

    def field_b(self):
        turned = Rotation.from_rotvec(np.multiply(0.25 * self.count, self.omega))
        return tuple(turned.inv().apply(FIELD_N).tolist())

    def step(self, sun_b=ACROSS, validity=VALID, eclipse=0, omega=ZERO, source=NO_RATE, field=None, dt=0.25):
        if field is None:
            field = HeldField(self.field_b(), True, self.count % self.divider == 0)
        self.state, output = control.step(
            self.p,
            self.state,
            self.memory,
            dt,
            sun_b,
            validity,
            eclipse,
            omega,
            source,
            np.zeros(0),
            field,
            np.zeros(0),
            self.dipoles,
        )
        self.count += 1
        return output

    def steps(self, count, **sample):
        for _ in range(count):
            output = self.step(**sample)
        return output


def test_nothing_is_done_before_two_measurements_make_a_pair():
    cycle = Cycle()
    for _ in range(4):
        assert cycle.step().torque_b == ZERO
        assert not np.any(cycle.dipoles)
    assert cycle.step().torque_b != ZERO
    assert np.any(cycle.dipoles)


def test_a_fast_body_is_damped_and_a_slow_one_spun():
    # rods too weak to show: the samples are those of a body that turns evenly
    cycle = Cycle("gains.damping=1e-7", "gains.spin=1e-7", omega=(0.2, 0.0, 0.0))
    output = cycle.steps(29)
    assert output.mode == MODE_DETUMBLE
    assert output.rate == pytest.approx(0.2, rel=0.1)
    assert output.torque_b[0] < 0.0
    slow = Cycle(omega=(0.0, 0.0, 0.0))
    output = slow.steps(29)
    assert output.mode == MODE_SUN_ACQUISITION
    assert output.pointing_error == pytest.approx(math.pi / 2.0)
    assert np.dot(output.torque_b, np.add(X, ACROSS)) > 0.0


def test_on_the_sun_it_says_so():
    assert Cycle(omega=ZERO).steps(29, sun_b=X).mode == MODE_SUN_POINT


def test_detumbling_for_good_does_not_heed_the_sun():
    seen, unseen = Cycle("law=detumble"), Cycle("law=detumble")
    for _ in range(21):
        first, second = seen.step(sun_b=X), unseen.step(sun_b=ZERO, validity=NONE)
        assert (first.torque_b, first.pointing_error) == (second.torque_b, -1.0)
    assert first.torque_b != ZERO


@pytest.mark.parametrize("validity", [NONE, HELD])
def test_a_sun_that_is_not_seen_leads_nowhere(validity):
    """A direction that is held turned with the body: only the spin is kept."""
    blind, elsewhere = Cycle(omega=ZERO), Cycle(omega=ZERO)
    first = blind.steps(21, sun_b=ACROSS, validity=validity)
    second = elsewhere.steps(21, sun_b=(0.0, -1.0, 0.0), validity=validity)
    assert first.torque_b == second.torque_b
    assert first.torque_b[0] > 0.0
    assert first.pointing_error == -1.0


@pytest.mark.parametrize(("behaviour", "acts"), [("spin", True), ("coast", False)])
def test_in_the_shadow_the_spin_is_kept_or_rods_rest(behaviour, acts):
    cycle = Cycle(f"eclipse_behaviour={behaviour}", omega=ZERO)
    output = cycle.steps(25, eclipse=1, validity=HELD)
    assert output.mode == MODE_ECLIPSE
    assert np.any(cycle.dipoles) == acts == (output.torque_b != ZERO)


def test_the_rate_of_an_estimator_is_taken_where_it_has_the_whole():
    rate = (0.0, 0.0, 0.03)
    own, other = Cycle(omega=ZERO), Cycle("rate_from=estimator", omega=ZERO)
    own.step(), other.step()  # the last of eight is then one in which rods act
    for source, same in ((NO_RATE, True), (2, True), (FIELD, False), (GYRO, False)):
        first, second = own.steps(8, omega=rate, source=source), other.steps(8, omega=rate, source=source)
        assert (first.torque_b == second.torque_b) == same
        assert second.rate == pytest.approx(first.rate if same else 0.03)


def test_dipoles_are_at_their_limit_before_the_torque_is_made_of_them():
    cycle = Cycle("gains.damping=1e-2", "rods.max_dipole=0.05", omega=(0.2, 0.1, 0.0))
    output = cycle.steps(9)
    assert np.abs(cycle.dipoles).max() == pytest.approx(0.05)
    assert output.rods_saturated != 0
    cycle.count -= 1
    np.testing.assert_allclose(output.torque_b, np.cross(cycle.dipoles, cycle.field_b()), rtol=1e-9)


def test_rods_rest_in_the_cycle_before_each_measurement():
    cycle = Cycle()
    cycle.steps(8)
    acting = [bool(cycle.step().torque_b != ZERO) for _ in range(12)]
    assert acting == [True, True, True, False] * 3
    always = Cycle("rest_before_measurement=false")
    always.steps(8)
    assert all(always.step().torque_b != ZERO for _ in range(12))


def test_missing_measurements_are_bridged_and_then_rods_rest():
    """The last one counts until the next is due; the component says for how long."""
    cycle = Cycle()
    cycle.steps(13)
    gone = HeldField(cycle.field_b(), False, False)
    assert cycle.step(field=gone).torque_b == ZERO
    assert not np.any(cycle.dipoles)
    assert cycle.steps(40, field=gone).torque_b == ZERO
    # two measurements later it acts again
    cycle.count = 0
    assert cycle.steps(4).torque_b == ZERO
    assert cycle.step().torque_b != ZERO


@pytest.mark.parametrize(
    "bad",
    [{"sun_b": NAN}, {"sun_b": (9.0, 0.0, 0.0)}, {"omega": NAN}, {"field": HeldField(NAN, True, True)},
     {"field": HeldField(ZERO, True, True)}, {"field": HeldField((0.0, math.inf, 0.0), True, True)}],
)  # fmt: skip
def test_what_is_no_number_gives_no_torque(bad):
    cycle = Cycle()
    cycle.steps(13)
    # safe mode is entered at the third
    for _ in range(3):
        output = cycle.step(**bad)
        assert np.all(np.isfinite(cycle.dipoles)) and np.all(np.isfinite(output.torque_b))
    assert output.torque_b == ZERO
    assert not np.any(cycle.dipoles)
    assert (output.mode == MODE_SAFE) == ("field" not in bad)


def test_switched_off_the_rods_rest():
    cycle = Cycle("enabled=false")
    assert cycle.steps(13).mode == MODE_SAFE
    assert not np.any(cycle.dipoles)


number = st.one_of(st.floats(-1.0, 1.0), st.floats())
any_vector = st.tuples(number, number, number)
sample = st.tuples(any_vector, any_vector, any_vector, st.integers(0, 3), st.booleans(), st.booleans(), number)


@settings(max_examples=100)
@given(st.lists(sample, min_size=1, max_size=12))
def test_finite_dipoles_within_limits_whatever_comes(samples):
    cycle = Cycle()
    cycle.steps(5)
    for sun_b, omega, field_b, kind, valid, fresh, dt in samples:
        field = HeldField(tuple(1e-4 * b for b in field_b), valid, fresh)
        output = cycle.step(sun_b, min(kind, 2), kind % 2, omega, kind, field, dt)
        assert np.all(np.abs(cycle.dipoles) <= 0.2 * (1.0 + 1e-12))
        assert np.all(np.isfinite(output.torque_b)) and math.isfinite(output.rate)
