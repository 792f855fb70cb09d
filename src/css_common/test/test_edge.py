# SPDX-License-Identifier: Apache-2.0
"""The checks at the edge: damaged stamps and messages are refused, counted and named once, good ones never."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sensor_msgs.msg import Imu

from css_common.codec import Sample, codec_of
from css_common.component import INERTIAL, Input
from css_common.edge import CONFIRMATIONS_BACK, HISTORY, Edge, StampGuard
from css_common.mission_section import MISSION
from css_common.readings import Readings
from css_common.schema import default_values
from css_common.sections import IO
from css_msgs.msg import CssVoltages, SpacecraftState

SECOND = 1_000_000_000
STEP = SECOND // 10
T0 = 1_370_044_800 * SECOND
GAP = 60 * SECOND


@pytest.fixture
def guard():
    """A guard that has seen three good stamps."""
    guard = StampGuard(GAP)
    assert [guard.refusal(T0 + k * STEP) for k in range(3)] == [None] * 3
    return guard


NOW = T0 + 2 * STEP


def follow(guard: StampGuard, first: int, count: int) -> list[str | None]:
    """What the guard says to successive stamps."""
    return [guard.refusal(first + k * STEP) for k in range(count)]


def test_forward_stamps_pass(guard):
    assert guard.refusal(NOW + 1) is None
    assert guard.refusal(NOW + 1 + GAP) is None


def test_repeated_stamp_is_refused(guard):
    assert [guard.refusal(NOW) for _ in range(50)] == ["stamp_repeated"] * 50
    assert guard.refusal(NOW + STEP) is None


def test_single_stamps_back_or_far_ahead_change_nothing(guard):
    for k, odd in enumerate((NOW - STEP, 0, -SECOND, NOW + 2 * GAP, 2**31 * SECOND)):
        assert guard.refusal(odd) == ("stamp_back" if odd < NOW else "stamp_jump")
        assert guard.refusal(NOW + (k + 1) * STEP) is None


def test_damaged_stamps_between_good_ones_never_add_up(guard):
    for k in range(1, 30):
        assert guard.refusal(NOW + 10 * GAP + k * STEP) == "stamp_jump"
        assert guard.refusal(NOW + k * STEP) is None


def test_damaged_stamps_in_a_row_that_do_not_agree_never_pass(guard):
    for k in range(30):
        assert guard.refusal(NOW + (100 - k) * 10 * GAP) == "stamp_jump"
    assert guard.refusal(NOW + STEP) is None


def test_clock_set_forward_is_followed(guard):
    answers = follow(guard, NOW + 1000 * SECOND, 10)
    assert answers == ["stamp_jump"] * 3 + [None] * 7


def test_clock_set_back_is_followed(guard):
    answers = follow(guard, NOW - 1000 * SECOND, CONFIRMATIONS_BACK + 5)
    assert answers == ["stamp_back"] * CONFIRMATIONS_BACK + [None] * 5


def test_restarted_sender_that_repeats_its_history_is_not_a_clock_set_back():
    guard = StampGuard(GAP)
    follow(guard, T0, 100)
    last = 99
    for missed in (0, 1):
        # it answers again what its topics held, up to the stamp that waits for it
        guard.expect_repetitions()
        again = [guard.refusal(T0 + (last + missed - HISTORY + 1 + k) * STEP) for k in range(HISTORY)]
        assert again == ["answered_again"] * (HISTORY - missed) + [None] * missed
    assert guard.last == T0 + 100 * STEP
    assert guard.refusal(T0 + 101 * STEP) is None


def test_first_stamp_sets_the_time_whatever_it_is():
    for first in (-SECOND, 0, 2**31 * SECOND):
        guard = StampGuard(GAP)
        assert guard.refusal(first) is None
        assert follow(guard, T0, HISTORY + 2)[-1] is None, "a damaged one locks nobody out"


stamps = st.one_of(
    st.integers(-(2**31) * SECOND, 2**31 * SECOND),
    st.integers(-20, 20).map(lambda k: T0 + k * STEP),
    st.integers(-3, 3).map(lambda k: T0 + k * GAP),
)


@given(st.lists(stamps, max_size=60))
def test_time_goes_forward_unless_a_sender_insists(sequence):
    guard = StampGuard(GAP)
    since = 0
    for stamp in sequence:
        last = guard.last
        if guard.refusal(stamp) is None:
            if last is not None and stamp <= last:
                assert since >= HISTORY
            elif last is not None and stamp > last + GAP:
                assert since >= 3
            since = 0
            assert guard.last == stamp
        else:
            since += 1
            assert guard.last == last


@given(st.lists(stamps, max_size=60))
def test_whatever_came_before_a_good_sender_is_soon_heard(sequence):
    guard = StampGuard(GAP)
    for stamp in sequence:
        guard.refusal(stamp)
    answers = follow(guard, T0 + 500 * STEP, HISTORY + 3)
    assert answers[-1] is None


class Bench:
    """One edge of voltages with its reports."""

    source = Input("voltages", "css/voltages", CssVoltages, lengths={"voltages": 4})

    def __init__(self, source: Input | None = None, **changes) -> None:
        self.reports: list[str] = []
        self.source = source or self.source
        self.edge = Edge(self.source, default_values(MISSION + IO, **changes), self.reports.append)
        self.codec = codec_of(self.source.message_type)
        self.step = 0

    def data(self, frame: str = "bus", **fields) -> bytes:
        """The next good message, with changes."""
        self.step += 1
        if self.source.lengths:
            fields.setdefault("voltages", np.full(4, 0.5))
        return self.codec.encode(self.codec.sample(T0 + self.step * STEP, frame, **fields))

    def offer(self, data: bytes) -> Sample | None:
        """What the component would get."""
        return self.edge.accept(data)


@pytest.fixture
def bench() -> Bench:
    """An edge that has accepted one message."""
    bench = Bench()
    assert bench.offer(bench.data()) is not None
    return bench


BAD = {
    "malformed": (lambda b: b.data()[:-1], "css/voltages: malformed: css_msgs/msg/CssVoltages: "),
    "wrong_length": (
        lambda b: b.data(voltages=np.zeros(3)),
        "css/voltages: wrong_length: 3 voltages given, expected 4 (further ones are counted, not reported)",
    ),
    "wrong_frame": (lambda b: b.data(frame="body"), "wrong_frame: frame_id 'body' given, expected 'bus'"),
    "not_finite": (lambda b: b.data(voltages=np.array([0, np.nan, 0, 0])), "not_finite: voltages holds NaN or inf"),
    "stamp_repeated": (
        lambda b: b.codec.encode(b.codec.sample(T0 + STEP, "bus", voltages=np.zeros(4))),
        f"stamp_repeated: stamp {T0 + STEP} ns given, last accepted {T0 + STEP} ns",
    ),
    "stamp_back": (lambda b: b.codec.encode(b.codec.sample(T0, "bus", voltages=np.zeros(4))), "stamp_back: "),
    "stamp_jump": (
        lambda b: b.codec.encode(b.codec.sample(T0 + 10**8 * SECOND, "bus", voltages=np.zeros(4))),
        "stamp_jump: stamp",
    ),
}


@pytest.mark.parametrize("kind", BAD)
def test_bad_message_is_refused_counted_and_reported_once(bench, kind):
    make, report = BAD[kind]
    for _ in range(3):
        assert bench.offer(make(bench)) is None
    assert bench.edge.rejected == {kind: 3}
    assert bench.edge.accepted == 1
    assert len(bench.reports) == 1
    assert report in bench.reports[0]
    assert "\n" not in bench.reports[0]


def test_kinds_are_counted_and_reported_each(bench):
    for make, _ in BAD.values():
        bench.offer(make(bench))
    assert bench.edge.rejected == dict.fromkeys(BAD, 1)
    assert len(bench.reports) == len(BAD)


@pytest.mark.parametrize("kind", BAD)
def test_good_messages_pass_after_a_bad_one(bench, kind):
    bench.offer(BAD[kind][0](bench))
    sample = bench.offer(bench.data(voltages=np.array([0.1, 0.2, 0.3, 0.4])))
    assert sample.voltages.tolist() == [0.1, 0.2, 0.3, 0.4]
    assert bench.edge.accepted == 2


@pytest.mark.parametrize("kind", ["malformed", "wrong_length", "wrong_frame", "not_finite"])
def test_refused_message_does_not_move_the_clock(bench, kind):
    last = bench.edge.guard.last
    bench.offer(BAD[kind][0](bench))
    assert bench.edge.guard.last == last


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("index", [0, 3])
def test_every_kind_of_not_finite_anywhere_in_an_array(bench, bad, index):
    voltages = np.zeros(4)
    voltages[index] = bad
    assert bench.offer(bench.data(voltages=voltages)) is None
    assert bench.edge.rejected == {"not_finite": 1}


def test_huge_numbers_are_finite(bench):
    assert bench.offer(bench.data(voltages=np.array([1e308, -1e308, 5e-324, 0.0]))) is not None


def test_unused_fields_may_hold_anything():
    # a driver without accelerometers leaves NaN there
    bench = Bench(Input("gyro", "gyro/imu", Imu, used=("angular_velocity",)))
    assert bench.offer(bench.data(linear_acceleration=np.full(3, np.nan))) is not None
    assert bench.offer(bench.data(angular_velocity=np.full(3, np.nan))) is None


def test_fields_that_a_type_does_not_have_are_no_input():
    with pytest.raises(KeyError, match="angular_rate"):
        Bench(Input("gyro", "gyro/imu", Imu, used=("angular_rate",)))


def test_frames():
    accepted = Bench(io__body_frame="body", io__accepted_frames=["imu_link", ""])
    for frame in ("body", "imu_link", ""):
        assert accepted.offer(accepted.data(frame=frame)) is not None
    assert accepted.offer(accepted.data(frame="bus")) is None
    inertial = Bench(Input("truth", "truth", SpacecraftState, frame=INERTIAL))
    assert inertial.offer(inertial.data(frame="eci")) is not None
    assert inertial.offer(inertial.data(frame="bus")) is None


def test_slow_topics_are_not_from_another_time():
    # due every 1000 s, with a largest gap of 60 s
    slow = Bench(Input("voltages", "css/voltages", CssVoltages, divider=100), mission__period=10.0)
    for k in range(20):
        data = slow.codec.encode(slow.codec.sample(T0 + k * 1000 * SECOND, "bus"))
        assert slow.offer(data) is not None


@given(st.lists(st.one_of(st.binary(max_size=120), st.sampled_from(sorted(BAD))), max_size=40))
def test_nothing_that_arrives_raises_and_everything_is_counted(arrivals):
    bench = Bench()
    for arrival in arrivals:
        bench.offer(arrival if isinstance(arrival, bytes) else BAD[arrival][0](bench))
    assert bench.edge.accepted + bench.edge.rejected.total() == len(arrivals)
    assert len(bench.reports) == len(bench.edge.rejected)


CELLS = Input("cells", "css/voltages", CssVoltages, lengths={"voltages": 2}, readings={"voltages": Readings(-1.0, 2.0)})
FAULTS = {
    "": lambda sample: None,
    "frame": lambda sample: setattr(sample, "frame_id", "bux"),
    "length": lambda sample: setattr(sample, "voltages", np.ones(3)),
    "missing": lambda sample: setattr(sample, "voltages", np.array([1.0, np.nan])),
    "impossible": lambda sample: setattr(sample, "voltages", np.array([1.0, 2.5])),
    "infinite": lambda sample: setattr(sample, "voltages", np.array([-np.inf, 1.0])),
}


@given(
    st.lists(
        st.tuples(st.sampled_from([1, 1, 1, 1, 0, -1, 2, 700]), st.sampled_from([*FAULTS, *[""] * 20])), max_size=9
    ),
    st.integers(0, 3),
)
def test_ordinary_messages_are_accepted_ones_with_nothing_to_say(sent, before):
    codec = codec_of(CssVoltages)
    said: list[str] = []
    one_by_one, at_once = (Edge(CELLS, default_values(MISSION + IO), said.append) for _ in range(2))
    data, step = [], 0
    for advance, fault in [(1, "")] * before + sent:
        step += advance
        sample = codec.sample(T0 + step * STEP, "bus", voltages=np.array([0.5, 1e-3 * step]))
        FAULTS[fault](sample)
        data.append(codec.encode(sample))
    for message in data[:before]:
        assert one_by_one.accept(message) is not None and at_once.accept(message) is not None
    columns = at_once.ordinary(data[before:])
    given = [one_by_one.accept(message) for message in data[before:]]
    accepted = [sample for sample in given if sample is not None]
    is_ordinary = bool(sent) and len(accepted) == len(given) and not said
    assert (columns is not None) == is_ordinary
    if columns is not None:
        at_once.take(columns)
        np.testing.assert_array_equal(columns.voltages, [sample.voltages for sample in accepted])
        np.testing.assert_array_equal(columns.stamp_ns, [sample.stamp_ns for sample in accepted])
        assert (at_once.accepted, vars(at_once.guard)) == (one_by_one.accepted, vars(one_by_one.guard))
