# SPDX-License-Identifier: Apache-2.0
"""Messages come out sorted and whole, whatever the order in which they came."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from presence import present

from css_recording.second_buffer import SECOND_NS, BufferLimits, SecondBuffer

STEP_NS = SECOND_NS // 10
LIMITS = BufferLimits(hold_back_ns=2 * STEP_NS)


def run(messages, limits=LIMITS):
    buffer = SecondBuffer(limits)
    batches = []
    for message in messages:
        batches += buffer.add(message) or []
    return batches + buffer.drain(), buffer.late_messages


def regular(steps, topics=3):
    return [(step * STEP_NS, topic, bytes([step % 256, topic]), 0) for step in range(steps) for topic in range(topics)]


@given(st.integers(0, 2**32), st.integers(1, 45))
def test_order_of_arrival_within_the_hold_back_time_leaves_no_trace(seed, steps):
    messages = regular(steps)
    # each message is up to two steps late: the hold-back time
    delays = random.Random(seed)
    arrival = sorted(messages, key=lambda message: message[0] + delays.randint(0, 2) * STEP_NS)
    batches, late = run(arrival)
    assert late == 0
    assert batches == run(messages)[0]
    assert [message for batch in batches for message in batch] == messages


@given(st.lists(st.tuples(st.integers(0, 8 * SECOND_NS), st.integers(0, 3), st.binary(max_size=40), st.just(0))))
def test_nothing_is_lost_or_made_up_for_any_stamps(messages):
    batches, _ = run(messages, BufferLimits(open_bytes=200))
    assert sorted(message for batch in batches for message in batch) == sorted(messages)
    for batch in batches:
        assert [message[:2] for message in batch] == sorted(message[:2] for message in batch)


def test_each_span_is_one_batch_and_comes_out_when_it_is_over():
    buffer = SecondBuffer(LIMITS)
    for message in regular(10):
        assert not buffer.add(message)
    (batch,) = present(buffer.add(regular(11)[-1]))
    assert batch == regular(8)
    assert len(buffer.held()) == 2 * 3 + 1


@pytest.mark.parametrize(
    ("hold_back_steps", "most_ns"), [(0, SECOND_NS), (2, SECOND_NS), (5, SECOND_NS), (20, SECOND_NS * 5 // 2)]
)
def test_what_is_held_spans_less_than_a_second_or_the_hold_back_time_and_half_of_one(hold_back_steps, most_ns):
    buffer = SecondBuffer(BufferLimits(hold_back_ns=hold_back_steps * STEP_NS))
    most = 0
    for message in regular(500):
        buffer.add(message)
        stamps = [held[0] for held in buffer.held()]
        most = max(most, max(stamps) - min(stamps) if stamps else 0)
    assert most == most_ns - STEP_NS


@pytest.mark.parametrize("cut", [1, 8 * 3, 9 * 3, 30])
def test_what_follows_a_flush_within_its_span_is_not_late(cut):
    """A flush hands out what is there; the span that it cut goes on, and nothing of it is out of order."""
    messages = regular(20)
    buffer = SecondBuffer(LIMITS)
    batches = [batch for message in messages[:cut] for batch in buffer.add(message) or []]
    batches += buffer.drain()
    assert [message for batch in batches for message in batch] == messages[:cut] and buffer.held() == []
    rest = [batch for message in messages[cut:] for batch in buffer.add(message) or []] + buffer.drain()
    assert [message for batch in rest for message in batch] == messages[cut:]
    assert buffer.late_messages == 0


def test_what_follows_a_flush_from_before_its_last_span_is_late():
    buffer = SecondBuffer(LIMITS)
    for message in regular(20):
        buffer.add(message)
    buffer.drain()
    buffer.add(regular(8)[-1])  # the last of the first span of eight steps
    assert buffer.late_messages == 1
    assert buffer.drain() == [[regular(8)[-1]]]


def test_late_messages_are_kept_apart_counted_and_not_held_back():
    messages = regular(40)
    batches, late = run(messages[:3] + messages[60:90] + messages[3:6] + messages[90:])
    assert late == 3
    assert messages[3:6] in batches
    assert batches.index(messages[3:6]) < len(batches) - 1


def test_a_stray_stamp_of_the_future_splits_one_second_and_disturbs_no_other():
    messages = regular(40)
    stray = (10**6 * SECOND_NS, 0, b"", 0)
    batches, late = run([*messages[:5], stray, *messages[5:]])
    assert late == 19  # the rest of the span of 0.8 s that the stray stamp ended
    assert batches[:2] == [messages[:5], messages[24:48]]
    assert batches[2] == messages[5:24]
    assert batches[-1] == [stray]
    assert [message for batch in batches[3:-1] for message in batch] == messages[48:]


def test_a_flood_within_one_second_is_handed_out_in_parts():
    buffer = SecondBuffer(BufferLimits(open_bytes=1000))
    flood = [(5, 0, bytes(100), 0)] * 25
    batches = [batch for message in flood for batch in buffer.add(message) or []]
    assert [len(batch) for batch in batches] == [11, 11]
    assert buffer.late_messages == 0
    assert sum(len(message[2]) for message in buffer.held()) <= 1000
    assert [len(batch) for batch in buffer.drain()] == [3]


def test_equal_stamps_of_one_topic_keep_their_order():
    messages = [(7, 0, bytes([number]), 0) for number in range(9)]
    assert run(messages)[0] == [messages]
