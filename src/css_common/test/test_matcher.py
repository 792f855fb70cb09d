# SPDX-License-Identifier: Apache-2.0
"""Matching of inputs by their stamps: complete cycles only, in order, whatever the order of arrival."""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from css_common.codec import Sample
from css_common.component import Component, Input
from css_common.edge import HISTORY, StampGuard
from css_common.matching import Matcher
from css_common.message_columns import Columns
from css_common.mission_section import MISSION
from css_common.schema import default_values
from css_common.sections import IO
from css_msgs.msg import CssVoltages

SECOND = 1_000_000_000
STEP = SECOND // 10
VALUES = default_values(MISSION + IO)
T0 = 1_370_044_800 * SECOND


class Begun(Component):
    """Counts how often it began anew."""

    begun = 0

    def configure(self) -> None:
        """Begins."""
        self.begun += 1


def entry(key: str, *, required: bool = True, divider: int = 1, outlived: bool = False) -> Input:
    """An input called `key`."""
    return Input(key, f"topic/{key}", CssVoltages, required=required, divider=divider, outlived=outlived)


def matcher_of(inputs: Iterable[Input], awaited: Iterable[str] | None = None, **changes) -> Matcher:
    """A matcher of some inputs; without `awaited` all of them are."""
    inputs = tuple(inputs)
    component = Begun("begun", default_values(MISSION + IO, **changes))
    return Matcher(component, inputs, [i.key for i in inputs] if awaited is None else awaited)


def at(step: float) -> Sample:
    """A message of a step."""
    return Sample(T0 + round(step * STEP), "bus")


def offered(matcher: Matcher, *messages: tuple[str, float]) -> list[tuple[float, str]]:
    """Steps of the cycles that some messages complete, with the keys that were there."""
    cycles = []
    for key, step in messages:
        for stamp, received in matcher.offer(key, at(step)):
            present = {k: s for k, s in received.items() if s is not None}
            if matcher.exact:
                assert all(sample.stamp_ns == stamp for sample in present.values())
            assert received.keys() == matcher.inputs.keys()
            cycles.append(((stamp - T0) / STEP, "".join(sorted(present))))
    return cycles


AB = (entry("a"), entry("b"))
SLOW = replace(entry("t", required=False), held_s=1.0)
"""A quantity that changes slowly and comes at times of its own."""


def held(matcher: Matcher, *messages: tuple[str, float]) -> list[tuple[float, float | None]]:
    """Steps of the cycles that some messages complete, with the step of the message that is held in each."""
    cycles: list[tuple[float, float | None]] = []
    for key, step in messages:
        for stamp, received in matcher.offer(key, at(step)):
            kept = received["t"]
            cycles.append(((stamp - T0) / STEP, None if kept is None else (kept.stamp_ns - T0) / STEP))
    return cycles


@pytest.mark.parametrize("matching", ["exact", "latest"])
def test_a_slow_input_is_held_and_not_waited_for(matching):
    matcher = matcher_of((*AB, SLOW), io__input_matching=matching)
    pair = [("b", 0.0), ("a", 0.0)]
    assert held(matcher, *pair) == [(0.0, None)]
    assert held(matcher, ("t", 0.5), ("t", 1.5), ("b", 1.0), ("a", 1.0)) == [(1.0, 0.5)]
    assert held(matcher, ("b", 2.0), ("a", 2.0), ("b", 3.0), ("a", 3.0)) == [(2.0, 1.5), (3.0, 1.5)]
    # older than it may be
    assert held(matcher, ("b", 11.0), ("a", 11.0), ("b", 12.0), ("a", 12.0)) == [(11.0, 1.5), (12.0, None)]
    assert matcher.unmatched == 0 and matcher.missing() == ["topic/a", "topic/b"]


def test_stretches_without_a_slow_input_are_taken_at_once_and_others_message_by_message():
    matcher = matcher_of((*AB, SLOW))
    stamps = T0 + STEP * np.arange(3)
    columns = {key: Columns(stamps) for key in "ab"}
    places = {key: np.arange(3) * 2 + k for k, key in enumerate("ab")}
    assert matcher.ordinary(columns, places) is not None
    more = {"t": Columns(stamps[:1])}, {"t": np.array([6])}
    assert matcher.ordinary(columns | more[0], places | more[1]) is None
    held(matcher, ("t", -1.0))
    assert matcher.ordinary(columns, places) is None


@pytest.mark.parametrize("order", list(itertools.permutations("abc")))
def test_cycle_is_complete_with_the_last_input_in_any_order(order):
    matcher = matcher_of((*AB, entry("c")))
    assert offered(matcher, *[(key, 0) for key in order[:2]]) == []
    assert offered(matcher, (order[2], 0)) == [(0, "abc")]
    assert matcher.unmatched == 0


def test_inputs_that_run_ahead_of_each_other_are_matched_by_stamp():
    matcher = matcher_of(AB)
    assert offered(matcher, ("a", 0), ("a", 1), ("a", 2), ("b", 0), ("b", 1), ("b", 2)) == [
        (0, "ab"), (1, "ab"), (2, "ab"),
    ]  # fmt: skip
    assert matcher.unmatched == 0


def test_step_that_lost_an_input_is_left_behind_by_the_next():
    matcher = matcher_of(AB)
    assert offered(matcher, ("a", 0), ("a", 1), ("b", 1), ("b", 0)) == [(1, "ab")]
    assert matcher.unmatched == 2


def test_one_input_alone_is_never_a_cycle_of_two():
    matcher = matcher_of(AB)
    assert offered(matcher, *[("a", k) for k in range(200)]) == []


def test_an_input_that_nobody_awaited_does_not_stand_for_one_that_is():
    # c has no publisher in the mission, yet somebody publishes it
    matcher = matcher_of((*AB, entry("c", required=False)), awaited=("a", "b"))
    assert offered(matcher, ("a", 0), ("c", 0)) == []
    assert offered(matcher, ("b", 0)) == [(0, "abc")]
    assert offered(matcher, ("a", 1), ("b", 1), ("c", 1)) == [(1, "ab")]
    assert matcher.unmatched == 1


def test_repeated_messages_of_one_input_do_not_complete_a_cycle():
    matcher = matcher_of(AB)
    assert offered(matcher, ("a", 0), ("a", 0), ("a", 0)) == []
    assert offered(matcher, ("b", 0)) == [(0, "ab")]


def test_dividers():
    matcher = matcher_of((entry("a"), entry("m", divider=4)))
    assert offered(matcher, ("a", 0)) == []
    assert offered(matcher, ("m", 0)) == [(0, "am")]
    assert offered(matcher, ("a", 1), ("a", 2), ("a", 3)) == [(1, "a"), (2, "a"), (3, "a")]
    assert offered(matcher, ("m", 4), ("a", 4)) == [(4, "am")]


def test_a_message_that_is_not_due_does_not_stand_for_one_that_is():
    matcher = matcher_of((*AB, entry("m", divider=4)))
    assert offered(matcher, ("a", 1), ("m", 1)) == []
    assert offered(matcher, ("b", 1)) == [(1, "abm")]


def test_cycle_without_anything_due_runs_on_what_comes():
    matcher = matcher_of((entry("m", divider=4),))
    assert offered(matcher, ("m", 0), ("m", 1), ("m", 4)) == [(0, "m"), (1, "m"), (4, "m")]


def test_optional_input_with_a_publisher_is_waited_for():
    matcher = matcher_of((entry("a"), entry("g", required=False)))
    assert offered(matcher, ("a", 0)) == []
    assert offered(matcher, ("g", 0)) == [(0, "ag")]


def overdue(matcher: Matcher) -> list[tuple[float, str]]:
    """Steps of the cycles that run at a deadline, with the keys that were there."""
    return [
        ((stamp - T0) / STEP, "".join(k for k, s in received.items() if s is not None))
        for stamp, received in matcher.overdue()
    ]


def test_at_the_deadline_a_cycle_runs_without_its_optional_inputs():
    matcher = matcher_of((entry("a"), entry("g", required=False)))
    assert offered(matcher, ("a", 0), ("a", 1)) == []
    assert matcher.oldest_pending() == T0
    assert matcher.missing() == ["topic/g"]
    assert overdue(matcher) == [(0, "a"), (1, "a")]
    assert matcher.oldest_pending() is None


def test_dead_optional_input_costs_one_deadline_and_is_awaited_again_when_it_speaks():
    matcher = matcher_of((entry("a"), entry("g", required=False)))
    offered(matcher, ("a", 0))
    overdue(matcher)
    assert offered(matcher, ("a", 1), ("a", 2)) == [(1, "a"), (2, "a")]
    assert offered(matcher, ("g", 2)) == []
    assert matcher.unmatched == 1
    assert offered(matcher, ("a", 3)) == []
    assert offered(matcher, ("g", 3)) == [(3, "ag")]


def test_required_inputs_are_waited_for_beyond_any_deadline():
    matcher = matcher_of((*AB, entry("g", required=False)))
    offered(matcher, ("a", 0), ("g", 0))
    assert overdue(matcher) == []
    assert matcher.missing() == ["topic/b"]
    assert offered(matcher, ("b", 0)) == [(0, "abg")]


def test_at_the_deadline_required_inputs_that_are_not_due_are_not_missed():
    matcher = matcher_of((entry("a"), entry("m", divider=4), entry("g", required=False)))
    offered(matcher, ("a", 1))
    assert overdue(matcher) == [(1, "a")]


def test_what_is_missing_before_anything_came():
    matcher = matcher_of((*AB, entry("g", required=False)), awaited=("a", "b"))
    assert matcher.missing() == ["topic/a", "topic/b"]
    assert matcher.oldest_pending() is None


def test_late_messages_are_counted_and_change_nothing():
    matcher = matcher_of(AB)
    offered(matcher, ("a", 5), ("b", 5))
    assert offered(matcher, ("a", 4), ("b", 4), ("b", 5)) == []
    assert matcher.unmatched == 3
    assert offered(matcher, ("a", 6), ("b", 6)) == [(6, "ab")]


def test_memory_is_bounded_and_newest_steps_are_kept():
    matcher = matcher_of(AB)
    offered(matcher, *[("a", k) for k in range(1000)])
    assert len(matcher._pending) <= 2 * HISTORY
    assert matcher.unmatched >= 1000 - 2 * HISTORY
    assert offered(matcher, ("b", 999)) == [(999, "ab")]


def test_time_set_back_begins_anew_and_cycles_again():
    matcher = matcher_of(AB)
    assert offered(matcher, *[(key, 1000 + k) for k in range(3) for key in "ab"])[-1] == (1002, "ab")
    begun = getattr(matcher._component, "begun")  # noqa: B009
    # the recording starts over; one input is there first, the other still speaks of the old time
    assert offered(matcher, ("a", 0), ("b", 1003), ("a", 1), ("b", 1)) == [(1, "ab")]
    assert matcher.set_back == 1
    assert getattr(matcher._component, "begun") == begun + 1  # noqa: B009
    assert offered(matcher, ("b", 2), ("a", 2)) == [(2, "ab")]
    assert matcher.set_back == 1


def test_leftovers_of_a_time_ahead_do_not_push_out_what_comes_now():
    # b never spoke: a's steps are pending when the recording starts over, this time with b
    matcher = matcher_of(AB)
    offered(matcher, *[("a", 1000 + k) for k in range(200)])
    assert offered(matcher, ("a", 0), ("b", 0), ("a", 1), ("b", 1)) == [(0, "ab"), (1, "ab")]


def test_input_whose_clock_never_agreed_does_not_stop_the_others():
    matcher = matcher_of((*AB, entry("g", required=False)), awaited=("a", "b"))
    cycles = offered(matcher, *[m for k in range(50) for m in (("a", 1000 + k), ("g", k), ("b", 1000 + k))])
    assert cycles == [(1000 + k, "ab") for k in range(50)]
    assert matcher.set_back == 0


def test_restarted_sender_that_answers_its_history_again_does_not_stop_the_cycle():
    # behind the edge as in a node: the sender of b died in step 100, a waits there, b repeats what it had held
    matcher, guard = matcher_of(AB), StampGuard(60 * SECOND)

    def arrive(step: int) -> list:
        return offered(matcher, ("b", step)) if guard.refusal(at(step).stamp_ns) is None else []

    for k in range(100):
        offered(matcher, ("a", k))
        assert arrive(k) == [(k, "ab")]
    offered(matcher, ("a", 100))
    guard.expect_repetitions()
    again = [cycle for k in range(101 - HISTORY, 101) for cycle in arrive(k)]
    assert again == [(100, "ab")]
    assert matcher.set_back == 0


LATEST: dict[str, Any] = {"io__input_matching": "latest", "io__deadline": 0.5}


def test_latest_takes_the_newest_of_each_when_the_first_speaks():
    matcher = matcher_of(AB, **LATEST)
    assert offered(matcher, ("b", 0.3), ("b", 0.7)) == []
    assert offered(matcher, ("a", 1)) == [(1, "ab")]
    assert matcher._latest["b"].stamp_ns == at(0.7).stamp_ns
    assert offered(matcher, ("a", 2), ("b", 2.1), ("a", 3)) == [(2, "ab"), (3, "ab")]


def test_latest_does_not_cycle_on_stale_required_inputs():
    matcher = matcher_of(AB, **LATEST)
    offered(matcher, ("b", 0))
    assert offered(matcher, ("a", 5)) == [(5, "ab")]
    assert offered(matcher, ("a", 5.1)) == []
    assert matcher.unmatched == 1
    assert offered(matcher, ("b", 5.2), ("a", 6)) == [(6, "ab")]


def test_latest_gives_none_for_stale_optional_inputs():
    matcher = matcher_of((entry("a"), entry("g", required=False)), **LATEST)
    assert offered(matcher, ("a", 0), ("g", 0.5), ("a", 1), ("a", 7)) == [(0, "a"), (1, "ag"), (7, "a")]


def test_latest_gives_a_measurement_that_counts_once_to_one_cycle_alone():
    measured = replace(entry("m", required=False), once=True)
    matcher = matcher_of((entry("a"), measured, entry("g", required=False)), **LATEST)
    given = offered(matcher, ("m", 0), ("g", 0), ("a", 0.1), ("a", 1.1), ("m", 1.5), ("m", 1.6), ("a", 2.1))
    assert given == [(0.1, "agm"), (1.1, "ag"), (2.1, "agm")]
    assert matcher.unmatched == 0


def test_latest_lets_what_comes_less_often_be_older():
    matcher = matcher_of((entry("a"), entry("m", required=False, divider=10)), **LATEST)
    # a deadline of 5 steps, and nine more for which the next one is not due
    assert offered(matcher, ("m", 0), ("a", 13.9), ("a", 14.1)) == [(13.9, "am"), (14.1, "a")]


def test_latest_takes_inputs_that_are_a_little_ahead():
    matcher = matcher_of(AB, **LATEST)
    assert offered(matcher, ("b", 4), ("a", 0)) == [(0, "ab")]
    matcher = matcher_of(AB, **LATEST)
    assert offered(matcher, ("b", 6), ("a", 0)) == []


@pytest.mark.parametrize("back_to", [50, 100])
def test_latest_begins_anew_also_at_the_very_stamp_of_the_last_cycle(back_to):
    matcher = matcher_of(AB, **LATEST)
    # the clock went on while b was silent, and was set back then
    assert offered(matcher, ("b", 100), ("a", 100), ("a", 200)) == [(100, "ab")]
    assert offered(matcher, ("a", back_to)) == []
    assert matcher.set_back == 1
    assert offered(matcher, ("b", back_to + 1), ("a", back_to + 1)) == [(back_to + 1, "ab")]


def test_latest_begins_anew_when_time_was_set_back():
    matcher = matcher_of(AB, **LATEST)
    assert offered(matcher, ("b", 1000), ("a", 1000), ("a", 0)) == [(1000, "ab")]
    assert matcher.set_back == 1
    assert offered(matcher, ("b", 0.5), ("a", 1)) == [(1, "ab")]


arrivals = st.lists(
    st.tuples(
        st.sampled_from("abgm"),
        st.one_of(st.integers(0, 12), st.integers(-(10**9), 10**9), st.floats(0, 12), st.just(None)),
    ),
    max_size=120,
)
INPUTS = (entry("a"), entry("b"), entry("g", required=False), entry("m", required=False, divider=4))


@pytest.mark.parametrize("matching", ["exact", "latest"])
@given(arrivals=arrivals, awaited=st.sets(st.sampled_from("gm")))
def test_any_sequence_gives_cycles_in_order_with_all_that_is_required(matching, arrivals, awaited):
    matcher = matcher_of(INPUTS, awaited={"a", "b"} | awaited, io__input_matching=matching)
    guards = {key: StampGuard(60 * SECOND) for key in "abgm"}
    last, timeline, taken = None, 0, 0
    for key, step in arrivals:
        if step is None:
            cycles = matcher.overdue()
        elif guards[key].refusal(at(step).stamp_ns) is not None:
            continue
        else:
            taken += 1
            cycles = matcher.offer(key, at(step))
        for stamp, received in cycles:
            if matcher.set_back != timeline:
                last, timeline = None, matcher.set_back
            assert last is None or stamp > last
            last = stamp
            for name, source in matcher.inputs.items():
                sample = received[name]
                if source.required:
                    assert sample is not None
                if sample is not None and matching == "exact":
                    assert sample.stamp_ns == stamp
                elif sample is not None:
                    assert abs(sample.stamp_ns - stamp) <= matcher.deadline_ns
        assert len(matcher._pending) <= 2 * HISTORY
        assert 0 <= matcher.unmatched <= taken


@given(st.permutations("aaaaaaaabbbbbbbb"))
def test_steps_whose_inputs_both_come_in_order_are_never_lost(order):
    # however the two senders interleave
    matcher = matcher_of(AB)
    messages = [(key, order[:i].count(key)) for i, key in enumerate(order)]
    assert offered(matcher, *messages) == [(k, "ab") for k in range(8)]
    assert matcher.unmatched == 0


@given(st.integers(0, 10**6), st.floats(-0.4, 0.4))
def test_number_of_a_step_is_that_of_the_nearest_cycle(step, off):
    component = Begun("begun", VALUES)
    assert component.step_of(component.epoch_ns + step * STEP + round(off * STEP)) == step


def test_samples_keep_what_they_were_given():
    sample = Sample(3, "bus", voltages=np.zeros(2))
    assert "voltages" in repr(sample)
    assert (sample.stamp_ns, sample.frame_id) == (3, "bus")


def state_of(matcher: Matcher) -> dict:
    """All that the coming messages are measured by."""
    private = {name: getattr(matcher, name) for name in ("_done", "_newest", "_missed", "_late", "_speaking")}
    return private | {"pending": {s: sorted(slots) for s, slots in vars(matcher)["_pending"].items()}}


def taken_at_once(matcher: Matcher, messages: Sequence[tuple[str, float]]) -> list[tuple[float, str]] | None:
    """As `offered`, for messages of which nothing is out of the ordinary."""
    stamps = {key: np.array([at(step).stamp_ns for k, step in messages if k == key]) for key, _ in messages}
    places = {key: np.array([n for n, (k, _) in enumerate(messages) if k == key]) for key in stamps}
    if any(np.any(np.diff(of_key) <= 0) for of_key in stamps.values()):
        return None  # the edge has let none of them pass
    columns = {key: Columns(of_key) for key, of_key in stamps.items()}
    found = matcher.ordinary(columns, places)
    if found is None:
        return None
    cycles, complete = found
    assert np.all(np.diff(complete) > 0)
    matcher.take(columns, cycles)
    keys = ["".join(sorted(k for k, rows in cycles.rows.items() if n in rows)) for n in range(len(cycles.stamps_ns))]
    return [((stamp - T0) / STEP, there) for stamp, there in zip(cycles.stamps_ns.tolist(), keys, strict=True)]


@given(
    st.lists(st.sampled_from(["ab", "ba", "a", "b", "", "ab", "ba", "ab"]), min_size=4, max_size=40),
    st.integers(0, 3),
    st.sampled_from([1, 2]),
    st.lists(st.integers(0, 80), max_size=3),
)
def test_messages_taken_at_once_are_those_taken_one_by_one(senders, lag, divider, cuts):
    # `b` comes some messages late, and is silent or alone now and then
    messages = [
        (n + (lag if key == "b" else 0), key, k) for k, of in enumerate(senders) for n, key in enumerate(of, 2 * k)
    ]
    sent = [(key, k) for _, key, k in sorted(messages) if key == "a" or k % divider == 0]
    inputs = (entry("a"), entry("b", divider=divider))
    one_by_one, at_once = matcher_of(inputs), matcher_of(inputs)
    edges = [0, *sorted(min(cut, len(sent)) for cut in cuts), len(sent)]
    for first, last in itertools.pairwise(edges):
        part = sent[first:last]
        given = taken_at_once(at_once, part) if part else []
        assert (offered(at_once, *part) if given is None else given) == offered(one_by_one, *part)
        assert state_of(at_once) == state_of(one_by_one)
        assert at_once.unmatched == one_by_one.unmatched


def test_a_whole_stretch_is_taken_at_once_and_one_with_a_gap_or_a_lag_is_not():
    inputs = (entry("a"), entry("b", divider=2))
    whole = [(key, k) for k in range(300) for key in "ab" if key == "a" or k % 2 == 0]
    assert taken_at_once(matcher_of(inputs), whole) == [(k, "a" if k % 2 else "ab") for k in range(300)]
    assert taken_at_once(matcher_of(inputs), [m for m in whole if m != ("b", 100)]) is None
    assert taken_at_once(matcher_of(inputs), [m for m in whole if m != ("a", 99)]) == [
        (k, "a" if k % 2 else "ab") for k in range(300) if k != 99
    ]
    # `b` so late that those which wait are given up
    late = sorted((k + 2 * HISTORY + 5 if key == "b" else k, key, k) for k in range(300) for key in "ab")
    assert taken_at_once(matcher_of(AB), [(key, k) for _, key, k in late]) is None
    ahead = matcher_of(AB)
    assert offered(ahead, ("a", 0)) == []
    assert taken_at_once(ahead, [("a", 1), ("b", 1)]) is None, "one waits already"


def test_a_required_input_that_may_be_outlived_is_done_without_once_overdue():
    matcher = matcher_of([entry("a", outlived=True), entry("b")])
    assert offered(matcher, ("a", 0), ("b", 0), ("b", 1)) == [(0, "ab")]
    assert overdue(matcher) == [(1, "b")]
    assert offered(matcher, ("b", 2), ("b", 3)) == [(2, "b"), (3, "b")]
    assert offered(matcher, ("a", 4), ("b", 4)) == [(4, "ab")]
    assert overdue(matcher_waiting_for_both()) == []


def matcher_waiting_for_both():
    """A matcher of two inputs of which neither may be outlived, one of them missing."""
    matcher = matcher_of([entry("a"), entry("b")])
    matcher.offer("b", at(0))
    return matcher


def test_another_input_paces_latest_cycles_when_the_one_that_does_is_outlived():
    matcher = matcher_of([entry("a", outlived=True), entry("b")], **LATEST)
    assert offered(matcher, ("b", 0), ("a", 0.1)) == [(0.1, "ab")]
    assert offered(matcher, ("b", 1), ("b", 5)) == []  # within the deadline of five steps
    assert offered(matcher, ("b", 6), ("b", 7)) == [(6, "b"), (7, "b")]
    assert offered(matcher, ("a", 7.5)) == [(7.5, "ab")]
    assert offered(matcher, ("b", 8)) == []
    matcher = matcher_of([entry("a"), entry("b")], **LATEST)
    assert offered(matcher, ("b", 0), ("a", 0.1), ("b", 20)) == [(0.1, "ab")]
