# SPDX-License-Identifier: Apache-2.0
"""Control modes: what leads to each, what leaves it, and that none is taken on one sample or chatters."""

import itertools
import math
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from css_common.schema import default_values
from sunpoint_control import modes
from sunpoint_control.modes import (
    MODE_DETUMBLE,
    MODE_ECLIPSE,
    MODE_SAFE,
    MODE_SUN_ACQUISITION,
    MODE_SUN_POINT,
    MODE_SUN_SEARCH,
    REASON_COMMANDED,
    REASON_IN_SHADOW,
    REASON_NO_RATE,
    REASON_NO_SUN,
    REASON_ON_SUN,
    REASON_POINTING_ERROR,
    REASON_RATE_HIGH,
    REASON_STALE_INPUT,
    next_mode,
    search_rate,
)

DT = 0.1
DEG = math.pi / 180.0


def parameters(**changes):
    changes = {name.replace("modes_", "modes__", 1): value for name, value in changes.items()}
    return modes.parameters(default_values(modes.PARAMETERS, **changes))


class Machine:
    """The mode machine fed with samples; what a sample does not say is a quiet sunlit acquisition at 60 deg."""

    def __init__(self, **changes):
        self.p = parameters(**changes)
        self.state = modes.initial_state()

    def feed(self, count=1, **sample):
        s = SimpleNamespace(ok=True, valid=True, shadow=False, error=60.0, rate=0.1, known=True)
        s.__dict__.update(sample)
        for _ in range(count):
            self.state = next_mode(
                self.p, self.state, DT, s.ok, s.valid, s.shadow, s.error * DEG, s.rate * DEG, s.known
            )
        return self.state.mode

    @property
    def reason(self):
        return self.state.reason


DARK = {"valid": False, "error": -1.0}


def test_acquires_from_the_first_sample():
    machine = Machine()
    assert machine.feed() == MODE_SUN_ACQUISITION
    assert machine.reason == REASON_POINTING_ERROR


@pytest.mark.parametrize(
    ("sample", "mode", "reason"),
    [
        ({"error": 5.0}, MODE_SUN_POINT, REASON_ON_SUN),
        ({"rate": 11.0}, MODE_DETUMBLE, REASON_RATE_HIGH),
        ({"shadow": True, **DARK}, MODE_ECLIPSE, REASON_IN_SHADOW),
        ({"shadow": True, "known": False, **DARK}, MODE_ECLIPSE, REASON_NO_RATE),
        ({"ok": False}, MODE_SAFE, REASON_STALE_INPUT),
    ],
)
def test_three_samples_lead_to_a_mode_and_two_do_not(sample, mode, reason):
    machine = Machine()
    assert machine.feed(2, **sample) == MODE_SUN_ACQUISITION
    assert machine.feed(1, **sample) == mode
    assert machine.reason == reason


def test_commanded_safe_mode_and_back():
    machine = Machine(enabled=False)
    assert machine.feed(3) == MODE_SAFE
    assert machine.reason == REASON_COMMANDED
    machine.p = parameters()
    assert machine.feed(2) == MODE_SAFE
    assert machine.feed(1) == MODE_SUN_ACQUISITION


def test_samples_that_disagree_do_not_add_up():
    machine = Machine()
    for _ in range(10):
        assert machine.feed(2, error=5.0) == MODE_SUN_ACQUISITION
        assert machine.feed(2, shadow=True) == MODE_SUN_ACQUISITION


def test_pointing_has_hysteresis():
    machine = Machine()
    machine.feed(5, error=14.0)
    assert machine.feed(50, error=29.0) == MODE_SUN_POINT
    assert machine.feed(3, error=31.0) == MODE_SUN_ACQUISITION
    assert machine.feed(50, error=16.0) == MODE_SUN_ACQUISITION
    assert machine.feed(3, error=14.0) == MODE_SUN_POINT


def test_detumbling_has_hysteresis():
    machine = Machine()
    machine.feed(3, rate=10.5)
    assert machine.feed(50, rate=5.5) == MODE_DETUMBLE
    assert machine.feed(3, rate=4.5) == MODE_SUN_ACQUISITION
    assert machine.feed(50, rate=9.5) == MODE_SUN_ACQUISITION


def test_a_rate_without_information_does_not_detumble():
    assert Machine().feed(50, rate=50.0, known=False) == MODE_SUN_ACQUISITION


def test_tip_off_rates_of_the_paper_do_not_detumble():
    assert Machine().feed(50, rate=2.0 * math.sqrt(3.0)) == MODE_SUN_ACQUISITION


def test_search_waits_then_turns_about_x_then_y_then_rests():
    machine = Machine(modes_search_angle_deg=90.0)
    assert machine.feed(199, **DARK) == MODE_SUN_ACQUISITION
    assert machine.reason == REASON_NO_SUN
    assert machine.feed(4, **DARK) == MODE_SUN_SEARCH
    axes = []
    for _ in range(3600):
        assert machine.feed(**DARK) == MODE_SUN_SEARCH
        axes.append(tuple(round(w / DEG, 9) for w in search_rate(machine.p, machine.state.search_time)))
    changes = [axes[0]] + [b for a, b in itertools.pairwise(axes) if a != b]
    assert changes[:4] == [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)]
    assert axes[:2000].count((0.0, 1.0, 0.0)) == pytest.approx(900, abs=1)  # 90 deg at 1 deg/s


def test_search_ends_after_a_second_of_sun():
    machine = Machine()
    machine.feed(210, **DARK)
    assert machine.feed(5) == MODE_SUN_SEARCH
    machine.feed(5, **DARK)
    assert machine.feed(9) == MODE_SUN_SEARCH
    assert machine.feed(4) == MODE_SUN_ACQUISITION


def test_eclipse_is_not_searched():
    machine = Machine()
    assert machine.feed(1000, shadow=True, **DARK) == MODE_ECLIPSE
    # nor is the moment after it, before the cells are counted as lit
    assert machine.feed(100, **DARK) == MODE_SUN_ACQUISITION


noise = st.floats(-1.0, 1.0)


@given(st.lists(noise, min_size=50, max_size=300), st.sampled_from([15.0, 30.0]))
def test_noise_about_a_threshold_does_not_chatter(samples, centre):
    """Noise much narrower than the hysteresis: at most one change of mode, wherever the mean lies."""
    machine = Machine()
    history = [machine.feed(error=centre + 5.0 * n) for n in samples]
    assert sum(a != b for a, b in itertools.pairwise(history)) <= 1


sample = st.fixed_dictionaries(
    {
        "ok": st.booleans(),
        "valid": st.booleans(),
        "shadow": st.booleans(),
        "error": st.sampled_from([-1.0, 5.0, 20.0, 60.0]),
        "rate": st.sampled_from([0.1, 7.0, 12.0]),
        "known": st.booleans(),
    }
)


@given(st.lists(sample, min_size=10, max_size=200), st.integers(2, 6))
def test_a_mode_lasts_at_least_the_debounce(samples, debounce):
    machine = Machine(modes_debounce=debounce)
    history = [machine.feed(**s) for s in samples]
    changes = [k for k in range(1, len(history)) if history[k] != history[k - 1]]
    assert all(b - a >= debounce for a, b in itertools.pairwise(changes))
    assert not changes or changes[0] >= debounce - 1
    assert set(history) <= set(range(6))


def test_conflicts_name_the_parameter():
    values = default_values(modes.PARAMETERS, modes__point_angle_deg=40.0, modes__detumble_exit_rate_deg_s=20.0)
    messages = list(modes.conflicts(values))
    assert any(m.startswith("modes.point_angle_deg") for m in messages)
    assert any(m.startswith("modes.detumble_exit_rate_deg_s") for m in messages)
    assert not list(modes.conflicts(default_values(modes.PARAMETERS)))


def test_too_few_actuators_are_safe_mode_until_there_are_enough_again():
    state = modes.initial_state()
    p = modes.parameters(default_values(modes.PARAMETERS))
    seen = []
    for disabled in [False] * 2 + [True] * 2 + [False] + [True] * 5 + [False] * 5:
        state = modes.next_mode(p, state, 0.1, True, True, False, 1.0, 0.01, True, disabled)
        seen.append((state.mode, state.reason))
    assert modes.MODE_SAFE not in [mode for mode, _ in seen[:7]]
    assert seen[9] == (modes.MODE_SAFE, modes.REASON_FAULT)
    assert seen[-1] == (modes.MODE_SUN_ACQUISITION, modes.REASON_POINTING_ERROR)
