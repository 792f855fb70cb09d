# SPDX-License-Identifier: Apache-2.0
"""A replay counts as identical only when every message of both sides has its like on the other."""

import math

import numpy as np
import pytest

from css_bringup.comparison import Comparison
from css_common.codec import codec_of
from css_msgs.msg import SunEstimate

CODEC = codec_of(SunEstimate)


def message(stamp_ns: int, **fields) -> bytes:
    return CODEC.encode(CODEC.sample(stamp_ns, "bus", **fields))


def compared(flown: dict[int, bytes], replayed: dict[int, bytes]) -> Comparison:
    comparison = Comparison(flown, CODEC)
    for stamp_ns, data in replayed.items():
        comparison.add(stamp_ns, data)
    return comparison


FLIGHT = {stamp: message(stamp, age=float(stamp)) for stamp in (10, 20, 30)}


def without(*stamps: int) -> dict[int, bytes]:
    return {stamp: data for stamp, data in FLIGHT.items() if stamp not in stamps}


def test_the_same_messages_are_identical_in_any_order():
    assert compared(FLIGHT, FLIGHT).identical
    assert compared(FLIGHT, dict(reversed(FLIGHT.items()))).identical
    assert compared(FLIGHT, FLIGHT).text() == "all 3 estimates are the bytes that flew"


@pytest.mark.parametrize("lost", [(10,), (20,), (30,), (10, 30)])
def test_a_message_on_one_side_only_is_no_identity(lost):
    for flown, replayed, side in ((FLIGHT, without(*lost), "flight"), (without(*lost), FLIGHT, "replay")):
        comparison = compared(flown, replayed)
        assert not comparison.identical
        assert (comparison.compared, comparison.unmatched, comparison.different) == (3 - len(lost), len(lost), [])
        assert comparison.first_unmatched == (lost[0], f"the {side}")
        assert comparison.as_object()["identical"] is False
        assert comparison.as_object()["first_unmatched_ns"] == lost[0]
        assert f"{len(lost)} stand on one side only, the first at {lost[0]} ns in the {side}" in comparison.text()


def test_as_many_messages_at_other_stamps_are_no_identity():
    comparison = compared(without(30), without(10))
    assert not comparison.identical
    assert (comparison.compared, comparison.unmatched) == (1, 2)
    assert comparison.first_unmatched == (10, "the flight")


def test_nothing_on_either_side_is_no_identity():
    assert not compared({}, {}).identical


def test_a_second_message_of_a_stamp_has_none_to_match():
    comparison = compared(FLIGHT, FLIGHT)
    assert not comparison.add(20, FLIGHT[20])
    assert not comparison.identical and comparison.unmatched == 1


@pytest.mark.parametrize(
    ("fields", "largest"),
    [
        ({"age": 20.5}, 0.5),
        ({"age": 20.0, "sun_b": np.array([0.0, -0.25, 0.125])}, 0.25),
        ({"age": 20.0, "mode": 3}, 3.0),
        ({"age": math.inf}, math.inf),
    ],
)
def test_other_bytes_are_counted_with_their_largest_difference(fields, largest):
    comparison = compared(FLIGHT, FLIGHT | {20: message(20, **fields)})
    assert not comparison.identical
    assert comparison.different == [20] and comparison.unmatched == 0
    assert comparison.largest_difference == largest
    assert comparison.as_object()["largest_difference"] == (largest if math.isfinite(largest) else None)
    assert comparison.as_object()["first_different_ns"] == 20
    assert comparison.text().startswith("1 of 3 estimates differ from the flight, first at 20 ns")


def test_only_messages_of_the_replay_alone_since_the_last_match_are_excused():
    comparison = Comparison(without(20, 30) | {40: FLIGHT[30]}, CODEC)
    for stamp in (5, 10, 20, 30):
        comparison.add(stamp, FLIGHT.get(stamp, b""))
    assert comparison.excuse_before(30) == 1  # that at 20; that at 5 lies before the match at 10, that at 30 not before
    assert comparison.excused == 1
    assert comparison.unmatched == 3
    assert comparison.first_unmatched == (5, "the replay")
