# SPDX-License-Identifier: Apache-2.0
"""Body rate from the magnetic field: closed forms of a body that turns at a constant rate, gaps, and the dark."""

import math

import numpy as np
import pytest
from clark_light import SWITCH, build, outputs
from hypothesis import given
from hypothesis import strategies as st

from css_common.attitude import rotation_vector_to_dcm
from css_common.vectors import cross, dot, multiply, scale, subtract
from css_estimation.sun.field_rate import FieldChange, FieldTrack, rate_about_sun, track_field
from css_estimation.sun.field_rate import initial_state as field_state
from css_estimation.sun.sun_heading import (
    PREDICTION_ECLIPSED,
    PREDICTION_SUNLIT,
    RATE_FIELD,
    RATE_GYRO,
    RATE_NONE,
    RATE_SUN,
    UNAIDED,
    UNKNOWN_SKY,
)

DT = 0.5
FIELD_T = 3e-5
OMEGA = (0.002, -0.003, 0.004)
SMALLEST_SINE = math.sin(math.radians(15.0))
component = st.floats(-1.0, 1.0)
directions = st.tuples(component, component, component).filter(lambda v: np.linalg.norm(v) > 0.1)


def unit(v):
    return tuple((np.asarray(v) / np.linalg.norm(v)).tolist())


def turned(v, omega, dt):
    return multiply(rotation_vector_to_dcm(scale(dt, omega)), v)


@given(directions, directions, st.tuples(component, component, component), st.floats(0.1, 2.0))
def test_rate_about_the_sun_line(sun, field, rate, dt):
    """Exact but for the third order of the angle in one interval, wherever the field is off the Sun line."""
    sun_b, later = unit(sun), scale(FIELD_T, unit(field))
    omega = scale(0.02, rate)
    previous = turned(later, omega, -dt)
    # sun_b as it is in the middle of the interval, where the formula takes the field
    middle_b = turned(sun_b, omega, -0.5 * dt)
    about = dot(omega, middle_b)
    across = subtract(omega, scale(about, middle_b))
    measured, known = rate_about_sun(middle_b, across, FieldChange(True, later, previous, dt), SMALLEST_SINE)
    sine = np.linalg.norm(np.cross(middle_b, np.add(later, previous))) / np.linalg.norm(np.add(later, previous))
    assert known == (sine > SMALLEST_SINE)
    if known:
        assert measured == pytest.approx(about, abs=(np.linalg.norm(omega) * dt) ** 2 * np.linalg.norm(omega) + 1e-12)
    else:
        assert measured == 0.0


def test_error_of_the_rate_falls_with_the_square_of_the_interval():
    """The field in the middle of two measurements makes it of second order; that of either end would be of first."""
    omega, sun_b, field_b = (0.05, -0.03, 0.04), unit((0.3, -0.5, -0.8)), scale(FIELD_T, unit((0.2, 1.0, -0.3)))
    about = dot(omega, sun_b)
    across_b = subtract(omega, scale(about, sun_b))
    errors = []
    for dt in (2.0, 1.0, 0.5):
        change = FieldChange(True, turned(field_b, omega, 0.5 * dt), turned(field_b, omega, -0.5 * dt), dt)
        errors.append(rate_about_sun(sun_b, across_b, change, SMALLEST_SINE)[0] - about)
    np.testing.assert_allclose(np.divide(errors[:-1], errors[1:]), 4.0, rtol=0.01)


@pytest.mark.parametrize("hold", [2.0, 10.0])
def test_the_field_is_followed_from_measurement_to_measurement(hold):
    """Which two make a pair, how far apart they are, and how old the rate from them has become."""
    p = build(SWITCH, rate__use_field=True, rate__field_hold=hold)[0].tracking.field
    earlier, later = scale(FIELD_T, unit((0.2, 1.0, -0.3))), scale(FIELD_T, unit((0.25, 1.0, -0.3)))
    track, change = track_field(p, field_state(), 0.5, measured(earlier))
    assert not change.known and track == FieldTrack(earlier, 0.0, -1.0)
    track, change = track_field(p, track, 0.5, UNAIDED)
    assert not change.known and track == FieldTrack(earlier, 0.5, -1.0)
    track, change = track_field(p, track._replace(age=0.25), 1.0, measured(later))
    assert change == FieldChange(True, later, earlier, 1.5)
    assert track == FieldTrack(later, 0.0, 1.25)
    # as long as it is held both are good, and not a cycle longer
    waited = track_field(p, track._replace(age=0.0), hold, UNAIDED)[0]
    assert waited == FieldTrack(later, hold, hold)
    assert track_field(p, track, hold, measured(earlier))[1].known
    over = track_field(p, track._replace(age=0.0), hold + 0.5, UNAIDED)[0]
    assert over == FieldTrack(later, -1.0, -1.0)
    assert not track_field(p, track, hold + 0.5, measured(earlier))[1].known


def measured(field_b):
    return UNAIDED._replace(field_b=field_b, field_valid=True)


class Flight:
    """A body that turns at a constant rate under a fixed Sun in a fixed field, the Clark estimator on board."""

    def __init__(self, field=(0.0, 1.0, -0.3), **changes):
        changes.setdefault("rate__use_field", True)
        self.p, self.state = build(SWITCH, **changes)
        self.sun_b, self.field_b = unit((0.3, -0.5, -0.8)), scale(FIELD_T, unit(field))

    def step(self, omega=OMEGA, measured=True, dark=False, gyro=False, field_b=None):
        self.sun_b, self.field_b = turned(self.sun_b, omega, DT), turned(self.field_b, omega, DT)
        light = np.zeros(14) if dark else outputs(self.sun_b)
        aiding = UNAIDED._replace(gyro_b=omega, gyro_valid=gyro, field_b=field_b or self.field_b, field_valid=measured)
        predicted = PREDICTION_ECLIPSED if dark else PREDICTION_SUNLIT
        self.state, heading = SWITCH.step(
            self.p, self.state, None, DT, light, aiding._replace(sky=UNKNOWN_SKY._replace(predicted=predicted))
        )
        return heading

    def fly(self, seconds, **conditions):
        return [self.step(**conditions) for _ in range(round(seconds / DT))][-1]


def across(omega, axis):
    axis = np.asarray(unit(axis))
    return np.asarray(omega) - np.dot(omega, axis) * axis


def test_sun_and_field_give_all_of_the_rate():
    flight = Flight()
    heading = flight.fly(30.0)
    assert heading.rate_source == RATE_FIELD
    # the rest is the converter's steps and the turning during one cycle
    np.testing.assert_allclose(heading.omega_bn_b, OMEGA, atol=2e-4)


def test_without_the_field_the_sun_line_stays_open():
    flight = Flight(rate__use_field=False)
    heading = flight.fly(30.0)
    assert heading.rate_source == RATE_SUN
    np.testing.assert_allclose(heading.omega_bn_b, across(OMEGA, flight.sun_b), atol=2e-4)


def test_a_gyro_comes_first():
    flight = Flight()
    heading = flight.fly(30.0, gyro=True, omega=(0.001, 0.002, 0.003))
    assert heading.rate_source == RATE_GYRO
    np.testing.assert_allclose(heading.omega_bn_b, (0.001, 0.002, 0.003), rtol=1e-6)


def test_measurements_every_fifth_cycle_do():
    flight = Flight()
    for k in range(200):
        heading = flight.step(measured=k % 5 == 0)
        assert k < 6 or heading.rate_source == RATE_FIELD
    np.testing.assert_allclose(heading.omega_bn_b, OMEGA, atol=3e-4)


def test_a_magnetometer_that_falls_silent_is_believed_for_ten_seconds():
    slow = scale(0.25, OMEGA)  # all faces that see the Sun go on seeing it
    flight = Flight()
    flight.fly(30.0, omega=slow)
    assert flight.fly(10.0, omega=slow, measured=False).rate_source == RATE_FIELD
    assert flight.fly(1.0, omega=slow, measured=False).rate_source == RATE_SUN
    heading = flight.fly(30.0, omega=slow, measured=False)
    np.testing.assert_allclose(heading.omega_bn_b, across(slow, flight.sun_b), atol=2e-4)
    # two measurements, far apart, are no pair
    assert flight.step(omega=slow).rate_source == RATE_SUN
    assert flight.step(omega=slow).rate_source == RATE_FIELD


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_field_along_the_sun_line_tells_nothing_about_it(sign):
    flight = Flight(field=scale(sign, unit((0.3, -0.5, -0.8))))
    heading = flight.fly(30.0)
    assert heading.rate_source == RATE_SUN
    np.testing.assert_allclose(heading.omega_bn_b, across(OMEGA, flight.sun_b), atol=3e-4)


def test_in_the_dark_the_field_gives_the_two_axes_across_it():
    flight = Flight()
    flight.fly(30.0)
    heading = flight.fly(60.0, dark=True)
    assert heading.rate_source == RATE_FIELD
    # the low-pass lags by 1.6 s, in which the field turns in b by 0.005 rad
    np.testing.assert_allclose(heading.omega_bn_b, across(OMEGA, flight.field_b), atol=2.5e-5)


def test_in_the_dark_without_field_there_is_nothing():
    flight = Flight()
    flight.fly(30.0)
    assert flight.fly(11.0, dark=True, measured=False).rate_source == RATE_NONE


@pytest.mark.parametrize("reading", [(math.nan, 0.0, 0.0), (math.inf, 0.0, 0.0), (0.0, 0.0, 0.0), (2.0, 0.0, 0.0)])
def test_readings_that_are_no_field_count_as_none(reading):
    flight = Flight()
    for _ in range(5):
        heading = flight.step(field_b=reading)
        assert all(map(math.isfinite, heading.omega_bn_b))
    assert heading.rate_source == RATE_SUN


def test_sign_of_the_definition():
    """A body that turns about z carries a field along x toward -y."""
    later = turned((FIELD_T, 0.0, 0.0), (0.0, 0.0, 0.01), DT)
    assert later[1] < 0.0
    assert cross(later, (0.0, 0.0, 0.01))[1] == pytest.approx((later[1] - 0.0) / DT, rel=1e-2)
    change = FieldChange(True, later, (FIELD_T, 0.0, 0.0), DT)
    assert rate_about_sun((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), change, SMALLEST_SINE)[0] == pytest.approx(0.01, rel=1e-4)
