# SPDX-License-Identifier: Apache-2.0
"""How far a flight is recorded."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from css_recording.recording_progress import RecordingProgress

T0, STEP = 1_000_000_000_000, 100
SPACING = {"/truth": STEP, "/estimate": STEP, "/field": 5 * STEP}


def progress(**spacing) -> RecordingProgress:
    """Three topics, one of them every five steps; told every ten."""
    return RecordingProgress(spacing or SPACING, T0, STEP, 10)


def note(followed: RecordingProgress, *messages: tuple[str, int]) -> list[int]:
    """Steps that were told while messages of (topic, step) came."""
    told = [followed.note(topic, T0 + step * STEP) for topic, step in messages]
    return [(stamp - T0) // STEP for stamp in told if stamp is not None]


def flight(steps) -> list[tuple[str, int]]:
    """What a flight publishes."""
    topics = {"/truth": 1, "/estimate": 1, "/field": 5}
    return [(topic, step) for step in steps for topic, divider in topics.items() if step % divider == 0]


def test_progress_is_told_every_ten_steps_and_never_ahead_of_any_topic():
    followed = progress()
    assert note(followed, *flight(range(31))) == [10, 20, 30]


def test_one_topic_that_lags_holds_the_progress_and_then_gives_it_free():
    followed = progress()
    assert note(followed, *[(t, k) for t, k in flight(range(60)) if t != "/estimate"]) == []
    assert note(followed, *[("/estimate", k) for k in range(60)]) == [10, 20, 30, 40, 50]


def test_a_topic_of_five_steps_is_complete_until_its_next_one_is_due():
    followed = progress()
    note(followed, *[("/truth", k) for k in range(20)], *[("/estimate", k) for k in range(20)])
    note(followed, ("/field", 0), ("/field", 5))
    assert followed.complete_ns == T0 + 9 * STEP


def test_unknown_topics_do_not_count():
    assert note(progress(), ("/diagnostics", 1000)) == []


def test_silent_topic_is_left_out_after_the_limit_and_counts_again_when_it_speaks():
    followed = progress()
    note(followed, *[(t, k) for t, k in flight(range(60)) if t != "/estimate"])
    assert followed.give_up_silent(0.0, 30.0) == ([], None)
    assert followed.give_up_silent(29.0, 30.0) == ([], None)
    given_up, told = followed.give_up_silent(30.0, 30.0)
    assert given_up == ["/estimate"]
    assert told == T0 + 59 * STEP
    assert note(followed, ("/estimate", 60)) == []
    assert note(followed, *[(t, k) for t, k in flight(range(60, 71)) if t != "/estimate"]) == []
    assert note(followed, ("/estimate", 70)) == [70]


def test_topic_that_is_slow_but_speaks_is_waited_for():
    followed = progress()
    note(followed, *[(t, k) for t, k in flight(range(60)) if t != "/estimate"])
    for k in range(50):
        note(followed, ("/estimate", k))
        assert followed.give_up_silent(20.0 * k, 30.0)[0] == []


def test_nobody_is_given_up_while_all_are_equally_far():
    followed = progress()
    note(followed, *flight(range(60)))
    for k in range(5):
        assert followed.give_up_silent(100.0 * k, 30.0)[0] == []


def test_topic_that_is_silent_on_purpose_is_not_waited_for():
    followed = progress()
    note(followed, *[(t, k) for t, k in flight(range(60)) if t != "/estimate"])
    assert followed.give_up_silent(0.0, 30.0, ["/estimate"])[0] == ["/estimate"]


@given(st.lists(st.sampled_from(sorted(SPACING)), max_size=400))
def test_what_is_told_is_there(order):
    followed, sent = progress(), dict.fromkeys(SPACING, -1)
    for topic in order:
        sent[topic] += 1
        told = followed.note(topic, T0 + sent[topic] * SPACING[topic])
        if told is not None:
            for name, spacing in SPACING.items():
                assert sent[name] >= (told - T0) // spacing


@pytest.mark.parametrize("steps", [1, 9, 10, 11])
def test_short_flights_tell_what_is_due(steps):
    assert note(progress(), *flight(range(steps + 1))) == [k for k in (10,) if k <= steps]
