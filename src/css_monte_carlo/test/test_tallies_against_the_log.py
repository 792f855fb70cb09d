# SPDX-License-Identifier: Apache-2.0
"""What the loop counts step by step against what the log of the same flight says, for flights made up at random.

Stretches are as long as the windows of the definitions, one step more and one less, so that a window that begins or
ends at another step is seen.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_flight import columns, estimates, flight, stamps, tilted

from css_analysis.estimator_runs import estimator_runs
from css_analysis.flight_log import FlightLog
from css_analysis.flight_metrics import FlightMeasures, Windows, acquisition, sunlit_passes
from css_common.kernel import typed_call
from css_estimation.sun.sun_heading import NO_COVARIANCE, VALIDITY_VALID, SunHeading
from css_monte_carlo.case_table import case_table
from css_monte_carlo.case_tallies import FINAL, LATE, REPORTED, SUNLIT, new_tallies, step_marks, tally_step
from css_monte_carlo.failing_units import NOTHING_FAILS
from css_monte_carlo.health_tallies import NO_ACTUATORS_LEFT
from css_monte_carlo.step_truth import Truth
from css_msgs.msg import RodDipoleCommand

_tally_step = typed_call(tally_step)
UP = (0.0, 0.0, 1.0)
STILL = (0.0, 0.0, 0.0)
WINDOWS = Windows(settled_time=300.0, late_time=300.0, report_time=3000.0, detumbled_rate_deg_s=0.3)
DIPOLE = 0.01  # [A m^2] more of it at every step
OFF_DEG = 2.0  # of the estimate from the true Sun


def heading(sun_b):
    return SunHeading(tuple(sun_b), NO_COVARIANCE, STILL, 0.0, 0.0, 0, 1, VALIDITY_VALID, 0, 0, 1, 0, 0)


def tallied(pointing_deg, illumination, rates, period_s):
    """Row of the case table of a flight with the Sun at angles from the array normal, and rates about it [rad/s]."""
    tallies = new_tallies(1, len(pointing_deg), period_s, 10, WINDOWS.detumbled_rate_deg_s)
    marks = step_marks(illumination, period_s, WINDOWS)
    true, estimated = tilted(pointing_deg), tilted(pointing_deg + OFF_DEG)
    for step, rate in enumerate(rates.tolist()):
        sun_b, said = tuple(true[step].tolist()), heading(estimated[step].tolist())
        truth = Truth(STILL, (0.0, 0.0, rate), sun_b, UP, STILL, STILL, DIPOLE * step, NOTHING_FAILS)
        _tally_step(tallies, 0, step, int(marks[step]), truth, said, None, None, NO_ACTUATORS_LEFT)
    (row,) = case_table(np.arange(1), tallies, period_s, WINDOWS).to_pylist()
    return row


def logged(pointing_deg, illumination, rates, period_s) -> FlightLog:
    log = flight(pointing_deg, illumination, ekf=estimates(tilted(pointing_deg + OFF_DEG)))
    truth = log.having("truth")
    truth.omega_bn_b[:, 2] = rates
    dipole = np.outer(DIPOLE * np.arange(len(rates)), (0.5, -0.3, 0.0, 0.2, 0.0, 0.0, 0.0, 0.0))
    log.rod_command = columns(RodDipoleCommand, truth.stamp_ns, dipole=dipole)
    truth.stamp_ns = log.estimates["ekf"].stamp_ns = stamps(len(rates), period_s)
    log.period = period_s
    return log


stretch = st.tuples(
    st.sampled_from([1, 5, 58, 59, 60, 61, 62, 120]),
    st.sampled_from([10.0, 29.0, 31.0, 80.0]),
    st.sampled_from([0.0, 0.5, 0.51, 1.0]),
)


@settings(max_examples=150)
@given(st.lists(stretch, min_size=1, max_size=6))
def test_a_flight_is_counted_as_it_is_logged(stretches):
    pointing = np.concatenate([np.full(n, angle) for n, angle, _ in stretches])
    light = np.concatenate([np.full(n, share) for n, _, share in stretches])
    rates = 0.01 * np.abs(np.cos(np.arange(len(pointing)) / 60.0))  # below 0.3 deg/s for 64 steps at a time
    row, log = tallied(pointing, light, rates, 1.0), logged(pointing, light, rates, 1.0)
    (run,) = estimator_runs(log)
    at = acquisition(log)
    assert row["acquired_s"] == (None if at is None else float(at))
    for key, of_the_log in (
        ("converging_s", "power_positive_s"),
        ("heading_error_mean_deg", "heading_error_mean_deg"),
        ("pointing_error_mean_deg", "pointing_error_mean_deg"),
        ("rate_final_deg_s", "rate_final_deg_s"),
    ):
        expected = run[of_the_log]
        assert row[key] == (None if expected is None else pytest.approx(expected, rel=1e-9)), key
    measures = FlightMeasures(log)
    measures.windows = WINDOWS
    assert row["detumbled_s"] == pytest.approx(measures.detumbled_s())
    assert row["power_positive_from_s"] == pytest.approx(measures.power_positive_from_s())
    assert row["power_positive_late"] == pytest.approx(measures.power_positive_late())
    assert row["rod_dipole_mean"] == pytest.approx(measures.rod_dipole_mean())
    first, *later = [sun.converging_s for sun in sunlit_passes(log)] or [0.0]
    assert (row["converging_first_s"], row["converging_later_s"]) == (first, sum(later))


@pytest.mark.parametrize("period_s", [1.0, 0.1, 0.25])
def test_windows_are_as_long_as_they_say(period_s):
    """Steps of the last minute, of the minute before 3000 s, and of the last 300 s of sunlight."""
    steps = round(3200.0 / period_s)
    illumination = np.ones(steps)
    dark = slice(round(2900.0 / period_s), round(3000.0 / period_s))
    illumination[dark] = 0.4
    marks = step_marks(illumination, period_s, WINDOWS)
    elapsed = np.arange(steps) * period_s

    def marked(mark):
        return elapsed[(marks & mark) != 0]

    np.testing.assert_allclose(marked(FINAL), elapsed[-round(60.0 / period_s) :])
    reported = marked(REPORTED)
    assert len(reported) == round(60.0 / period_s)
    assert (reported[0], reported[-1]) == pytest.approx((2940.0 + period_s, 3000.0))
    late = marked(LATE)
    assert len(late) == round(300.0 / period_s)
    # 200 s after the eclipse and 100 s before it
    assert (late[0], late[-1]) == pytest.approx((2800.0, 3200.0 - period_s))
    assert not np.any(marks[dark] & SUNLIT) and not np.any(marks[dark] & LATE)


def test_a_flight_that_ends_before_fifty_minutes_reports_nothing_then():
    assert not np.any(step_marks(np.ones(3000), 1.0, WINDOWS) & REPORTED)
    assert np.count_nonzero(step_marks(np.ones(3001), 1.0, WINDOWS) & REPORTED) == 60
