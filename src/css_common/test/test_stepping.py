# SPDX-License-Identifier: Apache-2.0
"""Stepping a component: when events are due, what they do, what may not go out, going back to an earlier step."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from testbed.nodes.estimator import Estimator

from css_common.codec import Sample
from css_common.mission import Event
from css_common.schema import ParameterError, checked_values
from css_common.stepping import Stepper, first_step, is_due

T0 = 1_370_044_800_000_000_000
STEP = 100_000_000


def stepper(*events: Event, **values) -> Stepper:
    canonical = checked_values(Estimator.table(), values)
    return Stepper(Estimator, "estimator", canonical, events, T0)


def event(time: float, action: str, parameter: str = "", value=None, node: str = "estimator") -> Event:
    return Event("change", time, node, action, parameter, value)


def outputs(steps: Stepper, *numbers: int) -> list[tuple[float, float]]:
    """Age and count of the estimates of some steps; zeros where there is none."""
    found = []
    for number in numbers:
        stamp_ns = T0 + number * STEP
        received = {"voltages": Sample(stamp_ns, "bus", voltages=np.ones(2)), "gyro": None}
        samples = [sample for _, sample in steps.checked(steps.step(stamp_ns, received))]
        found.append((samples[0].age, samples[0].nis) if samples else (0.0, 0.0))
    return found


def test_events_come_at_their_step_in_their_order_and_begin_anew_after_a_pause():
    steps = stepper(
        event(0.1, "set", "gain", 3.0),
        event(0.1, "set", "gain", 9.0, node="another"),
        event(0.3, "deactivate"),
        event(0.5, "activate"),
    )
    assert outputs(steps, *range(7)) == [(1, 1), (3, 2), (3, 3), (0, 0), (0, 0), (3, 1), (3, 2)]


def test_all_events_of_the_past_come_at_the_first_step():
    steps = stepper(event(0.1, "set", "gain", 3.0), event(0.2, "deactivate"), event(0.3, "activate"))
    assert outputs(steps, 50) == [(3.0, 1.0)]


def test_activating_what_is_active_changes_nothing():
    assert outputs(stepper(event(0.1, "activate")), 0, 1) == [(1, 1), (1, 2)]


def test_a_value_that_conflicts_is_refused_and_nothing_changes():
    steps = stepper(event(0.1, "set", "floor", 5.0))
    with pytest.raises(ParameterError, match=r"floor: 5\.0 given"):
        outputs(steps, 1)
    assert steps.canonical["floor"] == 0.0
    assert outputs(steps, 1) == [(1.0, 1.0)]


def test_what_is_not_finite_is_withheld_and_said():
    steps = stepper(fault="nan")
    told = []
    steps.withheld = lambda *what: told.append(what)
    assert outputs(steps, 0) == [(0.0, 0.0)]
    assert told == [("estimator/sun_estimate", "sun_b")]


def test_a_snapshot_can_be_gone_back_to_more_than_once():
    steps = stepper(event(0.2, "set", "gain", 3.0), event(0.4, "deactivate"))
    assert outputs(steps, 0, 1) == [(1, 1), (1, 2)]
    before = steps.snapshot()
    known = steps.component
    for _ in range(2):
        assert outputs(steps, 2, 3, 4) == [(3, 3), (3, 4), (0, 0)]
        steps.restore(before)
        assert steps.component is known and steps.is_active and steps.canonical["gain"] == 1.0


@given(st.floats(0.0, 1e6), st.integers(1, 60 * 10**9))
def test_the_first_step_of_an_event_is_due_and_the_one_before_is_not(time, period_ns):
    change = event(time, "activate")
    step = first_step(change, period_ns)
    assert is_due(change, step * period_ns)
    assert step == 0 or not is_due(change, (step - 1) * period_ns)


@pytest.mark.parametrize(("time", "expected"), [(0.0, 0), (0.3, 3), (0.30001, 4), (0.7, 7)])
def test_decimal_times_meet_their_own_step(time, expected):
    assert first_step(event(time, "activate"), STEP) == expected
