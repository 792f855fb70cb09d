# SPDX-License-Identifier: Apache-2.0
"""Rate source, age, validity and darkness, through whole estimators: what they share must be the same in each."""

import math

import numpy as np
import pytest
from okeefe_spacecraft import okeefe_values

from css_common.attitude import rotation_vector_to_dcm
from css_common.vectors import angle_between, cross, multiply, norm, scale, subtract
from css_estimation.sun import sunline_cycle, sunline_ekf, wavg
from css_estimation.sun.sun_heading import (
    RATE_GYRO,
    RATE_NONE,
    RATE_SUN,
    UNAIDED,
    VALIDITY_HELD,
    VALIDITY_NONE,
    VALIDITY_VALID,
)
from css_sensors.cells import CELLS

ESTIMATORS = pytest.mark.parametrize("estimator", [wavg, sunline_ekf], ids=["wavg", "ekf"])
NORMALS = np.asarray(okeefe_values(CELLS).cells.normals)
DT = 0.1
OMEGA = (0.004, -0.003, 0.0)


class Flight:
    """A body that turns at a constant rate under a fixed Sun, and an estimator on board."""

    def __init__(self, estimator, **changes):
        self.estimator = estimator
        self.p = estimator.parameters(okeefe_values(CELLS + estimator.PARAMETERS, **changes))
        self.state = estimator.initial_state(self.p)
        self.sun_b = (0.0, 0.0, 1.0)

    def step(self, lit=True, gyro=True, omega=OMEGA, dt=DT):
        self.sun_b = multiply(rotation_vector_to_dcm(scale(dt, omega)), self.sun_b)
        cosines = NORMALS @ self.sun_b
        seen = (cosines >= 0.5 - 1e-12) & (NORMALS[:, 2] * self.sun_b[2] > 0.0)
        voltages = np.where(seen, cosines, 0.0) * lit
        aiding = UNAIDED._replace(gyro_b=omega, gyro_valid=gyro)
        self.state, heading = self.estimator.step(self.p, self.state, None, dt, voltages, aiding)
        return heading

    def fly(self, steps, **conditions):
        return [self.step(**conditions) for _ in range(steps)]


@ESTIMATORS
def test_before_any_light_there_is_nothing(estimator):
    headings = Flight(estimator).fly(3, lit=False, gyro=False)
    assert all(h.validity == VALIDITY_NONE and h.sun_b == (0.0, 0.0, 0.0) for h in headings)
    assert all(h.covariance[0] == -1.0 and h.rate_source == RATE_NONE and h.age == 0.0 for h in headings)


@ESTIMATORS
def test_rate_sources(estimator):
    flight = Flight(estimator)
    assert flight.step(gyro=False).rate_source == RATE_NONE  # one vector is no pair
    assert flight.step(gyro=False).rate_source == RATE_SUN
    assert flight.step(gyro=True).rate_source == RATE_GYRO
    assert flight.step(gyro=False).rate_source == RATE_SUN
    assert flight.step(gyro=False, lit=False).rate_source == RATE_NONE
    assert flight.step(gyro=True, lit=False).rate_source == RATE_GYRO
    # the vector of before the darkness is no half of a pair
    assert flight.step(gyro=False).rate_source == RATE_NONE
    assert flight.step(gyro=False).rate_source == RATE_SUN


def test_a_filter_that_starts_anew_makes_no_rate_of_its_old_and_its_new_vector():
    """A silence so long that the covariance grew beyond use: both cycles are lit, and are no pair all the same."""
    flight = Flight(sunline_ekf)
    flight.fly(50, gyro=False)
    continued, anew = (Flight(sunline_ekf) for _ in range(2))
    for other in (continued, anew):
        other.state, other.sun_b = flight.state, flight.sun_b
    heading = continued.step(gyro=False, dt=100.0, omega=(1e-7, 0.0, 0.0))
    assert (heading.mode, heading.rate_source) == (sunline_cycle.MODE_TRACKING, RATE_SUN)
    heading = anew.step(gyro=False, dt=5e4, omega=(1e-7, 0.0, 0.0))
    assert (heading.mode, heading.rate_source) == (sunline_cycle.MODE_STARTED, RATE_NONE)
    assert heading.omega_bn_b == flight.state.sunline.tracking.omega_bn_b
    assert anew.step(gyro=False).rate_source == RATE_SUN


@ESTIMATORS
def test_gyro_is_ignored_when_it_may_not_be_used(estimator):
    flight = Flight(estimator, use_gyro=False)
    assert {h.rate_source for h in flight.fly(5)} == {RATE_NONE, RATE_SUN}


@ESTIMATORS
@pytest.mark.parametrize("reading", [(math.nan, 0.0, 0.0), (0.0, math.inf, 0.0), (0.0, 0.0, 1e6)])
def test_a_gyro_reading_that_is_none_counts_as_off(estimator, reading):
    flight = Flight(estimator)
    flight.fly(2)
    aiding = UNAIDED._replace(gyro_b=reading, gyro_valid=True)
    flight.state, heading = estimator.step(flight.p, flight.state, None, DT, np.ones(8), aiding)
    assert heading.rate_source != RATE_GYRO
    assert all(map(math.isfinite, (*heading.sun_b, *heading.omega_bn_b)))


@ESTIMATORS
def test_gyro_rate_passes_the_low_pass(estimator):
    headings = Flight(estimator).fly(100)
    gain = 1.0 - math.exp(-2.0 * math.pi * 0.1 * DT)
    for k in (0, 1, 10, 99):
        expected = 1.0 - (1.0 - gain) ** (k + 1)
        np.testing.assert_allclose(headings[k].omega_bn_b, scale(expected, OMEGA), rtol=1e-9, atol=1e-16)


@ESTIMATORS
def test_switching_the_gyro_in_flight_does_not_jump(estimator):
    """Both ways: neither heading nor rate moves by more than a filter step allows."""
    flight = Flight(estimator)
    flight.fly(300)
    before = flight.step()
    for gyro in (False, True, False, True):
        after = flight.step(gyro=gyro)
        # one step of the filter toward a rate that differs by at most the bias of the other source
        assert norm(subtract(after.omega_bn_b, before.omega_bn_b)) < 0.0609 * 1.2 * norm(OMEGA)
        assert angle_between(after.sun_b, before.sun_b) < 3.0 * norm(OMEGA) * DT
        before = flight.fly(30, gyro=gyro)[-1]


@ESTIMATORS
def test_rate_from_the_sun_is_the_part_normal_to_it(estimator):
    """WAVG differentiates a heading that is biased toward the pole; its rate has the bias's slope, one half."""
    flight = Flight(estimator)
    headings = flight.fly(150, gyro=False)
    omega = headings[-1].omega_bn_b
    sun_b = flight.sun_b
    normal = subtract(OMEGA, scale(np.dot(OMEGA, sun_b), sun_b))
    expected = 0.5 if estimator is wavg else 1.0
    assert np.dot(omega, normal) / np.dot(normal, normal) == pytest.approx(expected, abs=0.1)
    assert norm(cross(omega, normal)) < 0.1 * norm(normal) ** 2


@ESTIMATORS
def test_held_in_darkness(estimator):
    flight = Flight(estimator)
    flight.fly(100)
    headings = flight.fly(300, lit=False)
    assert all(h.validity == VALIDITY_HELD for h in headings)
    assert headings[-1].age == pytest.approx(30.0)
    assert headings[-1].lit_mask == 0
    # the gyro turned the held vector along with the body
    start_error = angle_between(flight.fly(1)[0].sun_b, flight.sun_b)
    assert angle_between(headings[-1].sun_b, flight.sun_b) < start_error + math.radians(5.5)
    back = flight.step()
    assert (back.validity, back.age) == (VALIDITY_VALID, 0.0)


def test_held_vector_may_stay_in_the_body():
    flight = Flight(wavg, propagate_held=False)
    lit = flight.fly(10)[-1]
    assert flight.fly(50, lit=False)[-1].sun_b == lit.sun_b


@ESTIMATORS
@pytest.mark.parametrize(("behaviour", "left"), [("hold", 1.0), ("zero", math.exp(-2.0 * math.pi * 0.1 * 5.0))])
def test_rate_in_darkness_without_gyro(estimator, behaviour, left):
    flight = Flight(estimator, rate__without_information=behaviour)
    lit = flight.fly(200)[-1]
    dark = flight.fly(50, lit=False, gyro=False)[-1]
    np.testing.assert_allclose(dark.omega_bn_b, scale(left, lit.omega_bn_b), rtol=1e-9)
    assert dark.rate_source == RATE_NONE


@ESTIMATORS
def test_eclipse_is_reported_after_ten_seconds_of_darkness(estimator):
    flight = Flight(estimator)
    flight.fly(20)
    headings = flight.fly(150, lit=False)
    assert [h.eclipse for h in headings].index(1) in (100, 101)
    assert not any(h.eclipse == 0 for h in flight.fly(49))
    assert flight.fly(3)[-1].eclipse == 0


def test_ekf_modes_tell_what_it_lives_on():
    flight = Flight(sunline_ekf)
    assert flight.step(lit=False).mode == sunline_cycle.MODE_WAITING
    assert flight.step().mode == sunline_cycle.MODE_STARTED
    assert flight.step().mode == sunline_cycle.MODE_TRACKING
    assert flight.step(lit=False).mode == sunline_cycle.MODE_PROPAGATING
    assert flight.fly(2, lit=False, gyro=False)[-1].mode == sunline_cycle.MODE_COASTING


def test_ekf_covariance_grows_in_darkness_to_its_bound():
    flight = Flight(sunline_ekf)
    flight.fly(50)
    trace = [h.covariance[0] + h.covariance[4] + h.covariance[8] for h in flight.fly(9000, lit=False, gyro=False)]
    assert np.all(np.diff(trace[:2000]) > 0.0)
    assert max(trace) <= 3.0 * 4.0 + 1e-9
    assert flight.step(gyro=False).mode == sunline_cycle.MODE_STARTED


def test_ekf_keeps_its_state_through_an_eclipse_with_gyro():
    flight = Flight(sunline_ekf)
    flight.fly(300)
    dark = flight.fly(21600, lit=False)[-1]  # 36 min
    assert angle_between(dark.sun_b, flight.sun_b) < math.radians(0.5)
    assert flight.step().mode == sunline_cycle.MODE_TRACKING
