# SPDX-License-Identifier: Apache-2.0
"""The magnetic field in the Sun filter: what a measurement of it does to the state, and a flight with it."""

import numpy as np
import pytest
from cell_layouts import LAYOUTS
from okeefe_spacecraft import okeefe_values
from sun_filter_flight import SunFilterFlight

from css_common.attitude import rotation_vector_to_dcm
from css_common.vectors import angle_between, multiply, unit
from css_estimation.nodes.sun_filter import SunFilter
from css_estimation.sun.sun_heading import UNAIDED, UNKNOWN_SKY
from css_estimation.sun_filter import sun_filter
from css_estimation.sun_filter.field_update import field_usable, read_field
from css_estimation.sun_filter.memory import GAIN, THETA, dcm_of, new_memory

FIELD_N = (1.2e-5, -2.1e-5, 1.8e-5)
P = sun_filter.parameters(okeefe_values(SunFilter.table(), use_field=True))
STATES = GAIN + 8


def turned(error, sigma):
    """A memory whose first attitude is wrong by a turn [rad] in n, known to sigma; and the field that is measured."""
    memory = new_memory(8)
    true = rotation_vector_to_dcm((0.4, -0.9, 0.3))
    memory.estimates[0, :9] = (np.array(true) @ np.array(rotation_vector_to_dcm(tuple(error))).T).ravel()
    memory.covariances[0][THETA : THETA + 3, THETA : THETA + 3] = sigma**2 * np.eye(3)
    return memory, multiply(true, FIELD_N)


def attitude_error(memory):
    true = rotation_vector_to_dcm((0.4, -0.9, 0.3))
    turn = np.array(dcm_of(memory.estimates[0])).T @ np.array(true)
    return 0.5 * np.array([turn[1, 2] - turn[2, 1], turn[2, 0] - turn[0, 2], turn[0, 1] - turn[1, 0]])


def test_a_field_takes_away_the_error_across_itself_and_leaves_that_along():
    along = np.array(unit(FIELD_N))
    error = np.array([0.02, -0.01, 0.03])
    memory, field_b = turned(error, 0.1)
    read = read_field(P, field_b, FIELD_N, False, STATES, memory.estimates[0], memory.covariances[0], memory)
    left = attitude_error(memory)
    assert read.used == 2 and not read.refused
    assert np.dot(left, along) == pytest.approx(np.dot(error, along), rel=0.02)
    assert np.linalg.norm(left - np.dot(left, along) * along) < 0.05 * np.linalg.norm(error)
    covariance = memory.covariances[0][THETA : THETA + 3, THETA : THETA + 3]
    assert along @ covariance @ along == pytest.approx(0.01)
    np.testing.assert_allclose(np.sort(np.linalg.eigvalsh(covariance))[:2], 1.1e-4, rtol=0.2)


def test_a_lasting_error_is_not_averaged_away():
    """A state that is better than the lasting error allows is left alone, however often the field is measured."""
    memory, field_b = turned((0.0, 0.0, 0.0), 0.1)
    biased = tuple(np.array(field_b) + np.array([3e-7, 0.0, 0.0]))
    for _ in range(500):
        read_field(P, biased, FIELD_N, False, STATES, memory.estimates[0], memory.covariances[0], memory)
    lasting = P.field.lasting / np.dot(FIELD_N, FIELD_N)
    smallest = np.linalg.eigvalsh(memory.covariances[0][THETA : THETA + 3, THETA : THETA + 3])[0]
    assert 0.4 * lasting < smallest < lasting
    assert np.linalg.norm(attitude_error(memory)) < 3.0 * np.sqrt(lasting)


def test_a_field_far_from_the_expected_one_is_refused():
    memory, field_b = turned((0.0, 0.0, 0.0), 0.01)
    before = memory.covariances[0].copy()
    turned_b = multiply(rotation_vector_to_dcm((0.5, 0.4, -0.3)), field_b)
    read = read_field(P, turned_b, FIELD_N, False, STATES, memory.estimates[0], memory.covariances[0], memory)
    assert read.refused and read.likelihood < -5.0
    assert read.used < 2 or np.array_equal(memory.covariances[0], before)


@pytest.mark.parametrize("field_b", [(np.nan, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (np.inf, 0.0, 0.0)])
def test_what_is_no_field_is_not_used(field_b):
    sky = UNKNOWN_SKY._replace(known=True, field_n=FIELD_N)
    aiding = UNAIDED._replace(field_valid=True, sky=sky)
    assert field_usable(P, aiding._replace(field_b=FIELD_N))
    assert not field_usable(P, aiding._replace(field_b=field_b))
    assert not field_usable(P, aiding._replace(field_b=FIELD_N, sky=UNKNOWN_SKY))


def test_with_the_field_the_turn_about_the_sun_line_is_known_at_once():
    """Under a dim Earth, without gyro: cells alone know one direction."""
    turns = {}
    for use_field in (True, False):
        flight = SunFilterFlight(
            unit((0.2, 0.5, 0.8)),
            (0.02, -0.03, 0.025),
            white=0.005,
            earth=(-0.9, 0.3, 0.2),
            use_field=use_field,
            **LAYOUTS["six faces"],
        )
        flight.field_n = FIELD_N
        heading = flight.fly(60.0)
        assert flight.error_deg(heading) < 1.0
        best = int(np.argmax(flight.memory.weights))
        true, estimated = np.array(flight.dcm_bn), np.array(dcm_of(flight.memory.estimates[best]))
        turns[use_field] = np.degrees(np.arccos(np.clip((np.trace(estimated.T @ true) - 1.0) / 2.0, -1.0, 1.0)))
        if use_field:
            np.testing.assert_allclose(heading.omega_bn_b, flight.omega, atol=2e-3)
    assert turns[True] < 2.0 < turns[False]


def test_the_field_holds_the_attitude_through_the_dark():
    flight = SunFilterFlight(
        unit((0.2, 0.5, 0.8)), (0.01, -0.02, 0.015), white=0.005, earth=(-0.9, 0.3, 0.2), use_field=True,
        rate__torque=1e-4, **LAYOUTS["six faces"],
    )  # fmt: skip
    flight.field_n = FIELD_N
    flight.fly(60.0)
    heading = flight.fly(300.0, part=0.0)
    across = angle_between(multiply(dcm_of(flight.memory.estimates[int(np.argmax(flight.memory.weights))]), FIELD_N),
                           multiply(flight.dcm_bn, FIELD_N))  # fmt: skip
    assert np.degrees(across) < 1.5
    assert flight.error_deg(heading) < 3.0 * np.degrees(np.sqrt(sum(heading.covariance[::4])))
