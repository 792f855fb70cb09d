# SPDX-License-Identifier: Apache-2.0
"""Finding the step at which something happened in flight, from the bytes that flew."""

from collections.abc import Callable

import numpy as np
import pytest

from css_bringup.comparison import Comparison
from css_bringup.flight_changes import ParameterChange, settings_in_flight
from css_bringup.retracing import Retrace
from css_common.codec import Sample, codec_of
from css_common.component import Component, Output
from css_common.mission import Event
from css_common.schema import checked_values, real
from css_common.stepping import Stepper
from css_msgs.msg import SunEstimate
from css_recording.parameter_events import RecordedSetting

STEP = 100_000_000
CODEC = codec_of(SunEstimate)


class Adder(Component):
    """Adds what it is given times a gain, and tells the sum at every fifth step only."""

    parameters = (
        real("gain", 1.0, "-", "factor", tunable=True),
        real("offset", 0.0, "-", "added to what is told", tunable=True),
    )

    @classmethod
    def outputs(cls, name, values):
        return (Output("estimate", "adder/sun_estimate", SunEstimate),)

    def configure(self) -> None:
        self.total = 0.0

    def cycle(self, stamp_ns, received):
        self.total += self.values.gain * received["cells"]
        told = self.total if self.step_of(stamp_ns) % 5 == 0 else 0.0
        return {"estimate": CODEC.sample(stamp_ns, "bus", age=told + self.values.offset)}


def stepper() -> Stepper:
    return Stepper(Adder, "adder", checked_values(Adder.table(), {}))


T0 = stepper().component.epoch_ns


def stamp(step: int) -> int:
    return T0 + step * STEP


def flown(steps: int, act: Callable[[Stepper, int], Stepper | None]) -> dict[int, bytes]:
    """Messages of a flight; before each step `act` may do something to the stepper, or replace it."""
    flying = stepper()
    messages: dict[int, bytes] = {}
    for step in range(steps):
        flying = act(flying, step) or flying
        if flying.is_active:
            for port, sample in flying.checked(flying.step(stamp(step), {"cells": float(step)})):
                messages[sample.stamp_ns] = port.codec.encode(sample)
    return messages


def retraced(messages: dict[int, bytes], steps: int, *changes: ParameterChange) -> tuple[Retrace, Comparison]:
    comparison = Comparison(messages, CODEC)
    retrace = Retrace(stepper(), comparison, changes, stepper)
    for step in range(steps):
        for _, sample, data in retrace.step(stamp(step), {"cells": float(step)}):
            comparison.add(sample.stamp_ns, data)
    retrace.finish()
    return retrace, comparison


@pytest.mark.parametrize("recorded", [30, 37, 44])
def test_a_change_that_shows_later_is_found_where_it_was_made(recorded):
    # the sum tells of it at step 40 only
    messages = flown(100, lambda s, k: s.set_values({"gain": 2.0}) if k == 37 else None)
    retrace, comparison = retraced(messages, 100, ParameterChange(stamp(recorded), {"gain": 2.0}))
    assert comparison.identical
    assert retrace.notes == [f"gain=2.0 was set before stamp {stamp(37)} ns, as the bytes show"]
    assert retrace.unplaced == []


def test_changes_that_took_effect_in_one_step_and_in_others():
    def act(s: Stepper, k: int) -> None:
        if k == 33:
            s.set_values({"gain": 2.0})
            s.set_values({"offset": 0.5})
        if k == 52:
            s.set_values({"gain": 3.0})

    changes = ({"gain": 2.0}, {"offset": 0.5}, {"gain": 3.0})
    recorded = (stamp(34), stamp(34), stamp(50))
    retrace, comparison = retraced(flown(100, act), 100, *map(ParameterChange, recorded, changes))
    assert comparison.identical
    assert len(retrace.notes) == 3


def test_a_step_that_cannot_be_found_is_named():
    messages = flown(700, lambda s, k: s.set_values({"gain": 2.0}) if k == 37 else None)
    # what was recorded is another value than what was set
    retrace, comparison = retraced(messages, 700, ParameterChange(stamp(37), {"gain": 2.5}))
    assert not comparison.identical and comparison.different[0] == stamp(40)
    assert [change.values for change in retrace.unplaced] == [{"gain": 2.5}]
    assert retrace.notes == []


def test_a_change_without_effect_on_the_bytes_is_made_all_the_same():
    messages = flown(400, lambda s, k: None)
    retrace, comparison = retraced(messages, 400, ParameterChange(stamp(37), {"gain": 1.0}))
    assert comparison.identical and retrace.unplaced == []


@pytest.mark.parametrize("step", [2, 59, 60])
def test_a_node_that_was_restarted_begins_anew_in_the_replay_too(step):
    retrace, comparison = retraced(flown(100, lambda s, k: stepper() if k == step else None), 100)
    assert comparison.identical and comparison.compared == 100
    assert retrace.notes == [f"the estimator began anew in flight at stamp {stamp(step)} ns"]


def test_a_node_that_was_restarted_has_lost_what_was_set_in_it():
    def act(s: Stepper, k: int) -> Stepper | None:
        if k == 33:
            s.set_values({"gain": 2.0})
        return stepper() if k == 60 else None

    retrace, comparison = retraced(flown(100, act), 100, ParameterChange(stamp(33), {"gain": 2.0}))
    assert comparison.identical
    assert retrace.notes[1] == f"the estimator began anew in flight at stamp {stamp(60)} ns"
    assert retrace.stepper.canonical["gain"] == 1.0


def test_a_pause_keeps_what_was_set_and_its_silence_is_excused():
    def act(s: Stepper, k: int) -> None:
        if k == 33:
            s.set_values({"offset": 2.0})
        if k == 60:
            s.deactivate()
        if k == 71:
            s.activate()

    retrace, comparison = retraced(flown(100, act), 100, ParameterChange(stamp(33), {"offset": 2.0}))
    assert comparison.identical and comparison.excused > 0
    assert "began anew" in retrace.notes[1] and "stamps without an estimate" in retrace.notes[1]
    assert retrace.stepper.canonical["offset"] == 2.0


def test_what_nothing_explains_stays_different():
    messages = flown(100, lambda s, k: None)
    sample = CODEC.decode(messages[stamp(50)])
    sample.age += 0.25
    messages[stamp(50)] = CODEC.encode(sample)
    retrace, comparison = retraced(messages, 100)
    assert comparison.different == [stamp(50)]
    assert comparison.largest_difference == pytest.approx(0.25)
    assert retrace.notes == []


def test_without_flown_bytes_a_change_is_made_after_the_stamp_of_its_record():
    retrace = Retrace(stepper(), None, [ParameterChange(stamp(10), {"offset": 1.0})], stepper)
    told = [retrace.step(stamp(k), {"cells": 0.0})[0][1].age for k in range(14)]
    assert told == [0.0] * 11 + [1.0] * 3


def test_settings_of_the_script_are_not_taken_twice_and_those_of_others_not_at_all():
    table = Adder.table()
    script = [Event("e", 1.0, "adder", "set", "gain", 2.0)]
    settings = [
        RecordedSetting(stamp(10), "adder", {"gain": 2.0}),
        RecordedSetting(stamp(20), "adder", {"gain": 2.0, "unknown": 1}),
        RecordedSetting(stamp(30), "another", {"gain": 3.0}),
        RecordedSetting(stamp(40), "adder", {"gain": "no number"}),
    ]
    assert settings_in_flight(settings, "adder", table, script) == [ParameterChange(stamp(20), {"gain": 2.0})]


def test_a_comparison_of_nothing_is_not_identical():
    nothing = Comparison({}, CODEC)
    assert not nothing.identical and "nothing could be compared" in nothing.text()
    one = Comparison({5: b"x"}, CODEC)
    one.add(6, b"x")
    assert (one.compared, one.unmatched, one.first_unmatched) == (0, 2, (5, "the flight"))


def test_differences_are_those_of_values_and_of_what_cannot_be_compared():
    data = CODEC.encode(CODEC.sample(5, "bus", sun_b=np.array([1.0, 0.0, 0.0])))
    other = CODEC.encode(CODEC.sample(5, "bus", sun_b=np.array([1.0, 0.0, -0.5])))
    frame = CODEC.encode(Sample(**{**vars(CODEC.decode(data)), "frame_id": "box"}))
    for replayed, expected in ((other, 0.5), (frame, np.inf), (b"damaged", np.inf)):
        comparison = Comparison({5: data}, CODEC)
        assert not comparison.add(5, replayed)
        assert comparison.largest_difference == expected
