# SPDX-License-Identifier: Apache-2.0
"""Single readings that are missing from a message: cleared, counted and named once, the others untouched."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from css_common.codec import codec_of
from css_common.component import Input
from css_common.edge import Edge
from css_common.mission_section import MISSION
from css_common.readings import Readings, all_readable, clear_unreadable
from css_common.schema import default_values
from css_common.sections import IO
from css_msgs.msg import CssVoltages

CODEC = codec_of(CssVoltages)
T0 = 1_370_044_800_000_000_000
STEP = 100_000_000
SOURCE = Input(
    "cells", "css/voltages", CssVoltages, lengths={"voltages": 4}, readings={"voltages": Readings(-0.5, 10.0)}
)


class Bench:
    """An edge and what it reports."""

    def __init__(self) -> None:
        self.reports: list[str] = []
        self.edge = Edge(SOURCE, default_values(MISSION + IO), self.reports.append)

    def offer(self, step: int, *voltages: float) -> list[float] | None:
        """What a component gets of some voltages; None when they are refused."""
        data = CODEC.encode(CODEC.sample(T0 + step * STEP, "bus", voltages=np.array(voltages)))
        sample = self.edge.accept(data)
        return None if sample is None else sample.voltages.tolist()


@pytest.fixture
def bench() -> Bench:
    """A fresh edge."""
    return Bench()


def test_whole_messages_are_neither_changed_nor_counted(bench):
    assert bench.offer(0, 0.0, -0.5, 10.0, 1.0) == [0.0, -0.5, 10.0, 1.0]
    assert (bench.edge.missing, bench.reports) == ({}, [])


def test_each_kind_is_counted_and_named_once(bench):
    nan = math.nan
    assert bench.offer(0, 0.1, nan, 0.3, nan)[::2] == [0.1, 0.3]
    got = bench.offer(1, -9999.0, 0.2, 65535.0, nan)
    assert got[1] == 0.2 and all(math.isnan(got[i]) for i in (0, 2, 3))
    bench.offer(2, 0.1, 0.2, 0.3, -0.6)
    assert bench.edge.missing == {"voltages.missing": 3, "voltages.impossible": 3}
    assert bench.edge.accepted == 3 and not bench.edge.rejected
    assert bench.reports == [
        "css/voltages: voltages[1] is not given: it counts as missing (further ones are counted, not reported)",
        "css/voltages: voltages[0] is -9999, expected -0.5 to 10: it counts as missing "
        "(further ones are counted, not reported)",
    ]


@pytest.mark.parametrize(
    ("voltages", "reason"),
    [
        ((math.nan,) * 4, "voltages holds no reading"),
        ((-9999.0, 65535.0, math.nan, -9999.0), "voltages holds no reading"),
        ((0.1, math.inf, 0.2, 0.3), "voltages holds infinity"),
        ((-math.inf, math.nan, 0.2, 0.3), "voltages holds infinity"),
    ],
)
def test_a_message_of_which_nothing_can_be_believed_is_refused(bench, voltages, reason):
    assert bench.offer(0, *voltages) is None
    assert bench.edge.rejected == {"not_finite": 1}
    assert bench.edge.missing == {}
    assert reason in bench.reports[0]


def test_what_is_refused_for_its_stamp_is_not_counted_as_missing(bench):
    bench.offer(0, 0.1, 0.2, 0.3, 0.4)
    assert bench.offer(0, 0.1, math.nan, 0.3, 0.4) is None
    assert bench.edge.rejected == {"stamp_repeated": 1}
    assert bench.edge.missing == {}


numbers = st.lists(st.floats(allow_nan=True, allow_infinity=True), max_size=12)


@given(numbers, st.floats(-5.0, 0.0), st.floats(0.0, 5.0))
def test_clearing_leaves_readings_and_nothing_else(values, smallest, largest):
    array = np.array(values, dtype=np.float64)
    readable = [smallest <= value <= largest for value in values]
    assert all_readable(array, smallest, largest) == all(readable)
    missing, impossible, first = clear_unreadable(array, smallest, largest)
    assert missing == sum(math.isnan(value) for value in values)
    assert missing + impossible == readable.count(False)
    for i, value in enumerate(values):
        assert array[i] == value if readable[i] else math.isnan(array[i])
    if impossible:
        assert not readable[first] and not math.isnan(values[first])
        assert all(ok or math.isnan(value) for ok, value in zip(readable[:first], values[:first], strict=True))
    else:
        assert first == -1
