# SPDX-License-Identifier: Apache-2.0
"""Replay takes ordinary stretches of a recording at once: the same bytes, counts and words as message by message."""

import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from flights import messages_by_topic
from rewritten_bag import REFERENCE, edited, on, rewritten
from sensor_msgs.msg import Imu, MagneticField

from css_bringup import replay_stretch
from css_bringup.replay_bag import mission_of_bag
from css_bringup.replay_pass import Replay, parse_request
from css_bringup.replay_stretch import Stretch
from css_common.codec import Sample, codec_of
from css_common.component import Cycles
from css_estimation.nodes.ekf import Ekf
from css_estimation.nodes.wavg import Wavg
from css_estimation.sun import wavg
from css_msgs.msg import CssVoltages, SunEstimate
from css_recording.bag_metadata import Topic
from css_recording.bag_reader import BagReader
from css_recording.bag_writer import BagWriter

SECOND = 1_000_000_000
STEPS = 1500
ONE_BY_ONE = sys.maxsize
with BagReader(REFERENCE) as _reader:
    START = _reader.start_ns
    MISSION = _reader.mission_text or ""
INPUTS = {"/css/voltages": CssVoltages, "/gyro/imu": Imu}


def step_of(stamp_ns: int) -> int:
    return (stamp_ns - START) // (SECOND // 10)


@pytest.fixture(autouse=True)
def taken_at_once(monkeypatch) -> list[int]:
    """Lengths of the stretches that were taken at once; they are cut short, so that a recording has several."""
    monkeypatch.setattr(replay_stretch, "STRETCH", 900)
    taken = []
    take = Stretch.take

    def noted(stretch: Stretch) -> list:
        given = take(stretch)
        taken.append(sum(message.topic.endswith("/sun_estimate") for message in given))
        return given

    monkeypatch.setattr(Stretch, "take", noted)
    return taken


def replayed(bag: Path, out: Path, requests: Iterable[str], overrides: Iterable[str], long_from: int) -> dict:
    """Everything that a replay gives and says."""
    with BagReader(bag) as reader:
        stepping = Replay(reader, mission_of_bag(bag, {}, overrides, None), map(parse_request, requests), overrides)
        stepping.long_from = long_from
        with BagWriter(out) as writer:
            stepping.run(writer)
        late = writer.late_messages
    runs = [
        {
            "counts": (run.messages, run.failures, run.matcher.unmatched, run.matcher.set_back),
            "said": [*run.notes, *run.matcher.complaints()],
            "compared": run.comparison and run.comparison.as_object() | {"text": run.comparison.text()},
        }
        for run in stepping.runs
    ]
    span = stepping.first_ns, stepping.last_ns
    noted = [stepping.rejected, stepping.missing, stepping.reports, [str(r) for r in reader.refused], late, span]
    return {"runs": runs, "noted": noted, "bytes": (out / "replay_0.mcap").read_bytes()}


def both_ways(bag: Path, tmp_path: Path, *requests: str, overrides: tuple[str, ...] = ()) -> dict:
    at_once = replayed(bag, tmp_path / "at_once" / "replay", requests, overrides, 0)
    one_by_one = replayed(bag, tmp_path / "one_by_one" / "replay", requests, overrides, ONE_BY_ONE)
    assert at_once.pop("bytes") == one_by_one.pop("bytes")
    assert at_once == one_by_one
    return at_once


def test_a_flight_without_incident_is_taken_at_once(taken_at_once, tmp_path):
    result = both_ways(REFERENCE, tmp_path, "ekf", "ekf:gyro=off", "wavg")
    assert len(taken_at_once) == 5 and sum(taken_at_once) == 3 * STEPS
    assert [run["counts"] for run in result["runs"]] == [(STEPS, 0, 0, 0)] * 3
    assert result["runs"][0]["compared"]["compared"] == STEPS


@pytest.mark.parametrize("source", ["model", "both"])
def test_what_the_models_say_of_the_sky_is_that_of_each_step(taken_at_once, tmp_path, source):
    both_ways(REFERENCE, tmp_path, f"wavg:eclipse.source={source}")
    assert sum(taken_at_once) == STEPS


def test_a_field_that_is_measured_now_and_then_belongs_to_its_step(taken_at_once, tmp_path):
    codec, rng = codec_of(MagneticField), np.random.default_rng(3)
    bag = tmp_path / "bag"
    with BagReader(REFERENCE) as reader, BagWriter(bag, metadata=reader.description) as writer:
        for topic in (*INPUTS, "/mag/field"):
            writer.add_topic(
                Topic(
                    topic,
                    "sensor_msgs/msg/MagneticField"
                    if "mag" in topic
                    else next(t.topic.type for t in reader.topics if t.topic.name == topic),
                )
            )
        for message in reader.messages(list(INPUTS)):
            writer.write(message.topic, message.stamp_ns, message.data)
            if message.topic == "/gyro/imu" and step_of(message.stamp_ns) % 5 == 0:
                off = step_of(message.stamp_ns) % 50 == 0
                field = codec.sample(
                    message.stamp_ns,
                    "bus",
                    magnetic_field=np.full(3, 9.0) if off else rng.normal(size=3) * 3e-5,
                    magnetic_field_covariance=np.eye(3).ravel() * (-1.0 if off else 1e-16),
                )
                writer.write("/mag/field", message.stamp_ns, codec.encode(field))
    overrides = ("magnetometer.divider=5",)
    both_ways(bag, tmp_path, "wavg:rate.use_field=true,use_gyro=false", "wavg:use_gyro=false", overrides=overrides)
    assert sum(taken_at_once) == 2 * STEPS
    estimates = messages_by_topic(tmp_path / "at_once" / "replay")
    with_field, without = (estimates[topic] for topic in sorted(estimates, key=len, reverse=True)[:2])
    assert [data for _, data in with_field] != [data for _, data in without], "the field is heeded"


def set_at(steps: set[int], message_type: type, edit: Callable[[Sample], object]) -> Callable[[int, bytes], bytes]:
    change = edited(message_type, edit)
    return lambda stamp_ns, data: change(stamp_ns, data) if step_of(stamp_ns) in steps else data


def dropped(*steps: int) -> Callable[[int, bytes], bytes | None]:
    return lambda stamp_ns, data: None if step_of(stamp_ns) in steps else data


def set_back(topic: str, stamp_ns: int, data: bytes) -> list[tuple[int, bytes]]:
    """The clock goes back by 30 s in the middle, while the recorder's goes on."""
    if topic in INPUTS and step_of(stamp_ns) >= 700:
        back = edited(INPUTS[topic], lambda sample: setattr(sample, "stamp_ns", sample.stamp_ns - 30 * SECOND))
        return [(stamp_ns, back(stamp_ns, data))]
    return [(stamp_ns, data)]


INCIDENTS = {
    "a missing reading": on("/css/voltages", set_at({700}, CssVoltages, lambda s: s.voltages.__setitem__(2, np.nan))),
    "no reading": on("/css/voltages", set_at({700}, CssVoltages, lambda s: setattr(s, "voltages", np.full(8, np.nan)))),
    "another frame": on("/gyro/imu", set_at({700, 702}, Imu, lambda s: setattr(s, "frame_id", "b0dy"))),
    "a damaged message": on("/gyro/imu", lambda stamp, data: data[:60] if step_of(stamp) == 700 else data),
    "a gyro that is off": on(
        "/gyro/imu", set_at(set(range(700, 720)), Imu, lambda s: s.angular_velocity_covariance.__setitem__(0, -1.0))
    ),
    "a gap in one input": on("/gyro/imu", dropped(700, 701)),
    "a stamp twice": lambda topic, stamp, data: [(stamp, data)] * (2 if step_of(stamp) == 700 else 1),
    "a clock that is set back": set_back,
    "an estimate that was lost": on("/ekf/sun_estimate", dropped(700)),
    "an estimate that differs": on("/ekf/sun_estimate", set_at({700}, SunEstimate, lambda s: setattr(s, "age", 9.0))),
    "estimates that all differ": on(
        "/ekf/sun_estimate", edited(SunEstimate, lambda s: setattr(s, "age", s.age + 1e-9))
    ),
}


@pytest.mark.parametrize("incident", INCIDENTS)
def test_an_incident_is_told_and_counted_as_message_by_message(taken_at_once, tmp_path, incident):
    bag = rewritten(tmp_path / "bag", INCIDENTS[incident])
    both_ways(bag, tmp_path, "ekf", "wavg")
    whole = "estimate" in incident or incident == "a gyro that is off"
    if incident != "a clock that is set back":
        given = sum(taken_at_once)
        assert given == 2 * STEPS if whole else abs(given - 2 * (STEPS - 300)) <= 2, "the other stretches are ordinary"


def test_a_fresh_state_is_found_behind_stretches_that_were_taken_at_once(taken_at_once, tmp_path):
    second_half = rewritten(
        tmp_path / "half", lambda topic, stamp, data: [(stamp, data)] if step_of(stamp) >= 703 else []
    )
    replayed(second_half, tmp_path / "half_out" / "replay", ["ekf"], (), ONE_BY_ONE)
    fresh = dict(messages_by_topic(tmp_path / "half_out" / "replay")["/ekf/sun_estimate"])
    bag = rewritten(tmp_path / "bag", on("/ekf/sun_estimate", lambda stamp, data: fresh.get(stamp, data)))
    result = both_ways(bag, tmp_path, "ekf", "wavg")
    (note,) = result["runs"][0]["said"]
    assert f"began anew in flight at stamp {START + 703 * SECOND // 10} ns" in note
    assert result["runs"][0]["compared"]["identical"]
    assert len(taken_at_once) == 5


def test_an_event_happens_at_its_step(taken_at_once, tmp_path):
    event = (
        "    events:\n      off: {time: 70.0, node: ekf, action: set, parameter: use_gyro, value: false}\n    criteria:"
    )
    mission = MISSION.replace("    criteria:", event, 1)
    bag = rewritten(tmp_path / "bag", lambda topic, stamp, data: [(stamp, data)], mission=mission)
    result = both_ways(bag, tmp_path, "ekf")
    assert result["runs"][0]["compared"]["different"] > 700
    assert len(taken_at_once) == 4


def test_a_cycle_that_fails_in_between_fails_alone(taken_at_once, tmp_path, monkeypatch):
    def failing(of: Callable) -> Callable:
        def cycle(component: Ekf, stamp_ns: int, received: object) -> object:
            if step_of(stamp_ns) == 700:
                raise ZeroDivisionError
            return of(component, stamp_ns, received)

        return cycle

    def cycle_through(component: Ekf, steps: Cycles) -> object:
        if START + 70 * SECOND in steps.stamps_ns:
            raise ZeroDivisionError
        return at_once(component, steps)

    at_once = Ekf.cycle_through
    monkeypatch.setattr(Ekf, "cycle", failing(Ekf.cycle))
    monkeypatch.setattr(Ekf, "cycle_through", cycle_through)
    result = both_ways(REFERENCE, tmp_path, "ekf:gyro=off", "ekf")
    assert [run["counts"][:2] for run in result["runs"]] == [(STEPS - 1, 1)] * 2


def test_an_estimator_with_a_cycle_of_its_own_is_stepped_by_it(tmp_path, monkeypatch):
    def held(component: Wavg, stamp_ns: int, received: object) -> dict:
        return {"estimate": component.message("estimate", stamp_ns, **FIELDS)}

    fields = codec_of(SunEstimate).sample(0, "")
    FIELDS = {field.name: getattr(fields, field.name) for field in codec_of(SunEstimate).fields}
    monkeypatch.setattr(Wavg, "cycle", held)
    both_ways(REFERENCE, tmp_path, "wavg")
    messages = messages_by_topic(tmp_path / "at_once" / "replay")["/wavg/sun_estimate"]
    assert not any(any(codec_of(SunEstimate).decode(data).sun_b) for _, data in messages)


def test_an_algorithm_with_parameters_of_another_is_stepped_by_its_own(taken_at_once, tmp_path, monkeypatch):
    called = []

    def step(*given: Any) -> Any:
        called.append(given)
        return wavg.step(*given)

    names = ("PARAMETERS", "parameters", "initial_state", "initial_memory")
    mirrored = SimpleNamespace(**{name: getattr(wavg, name) for name in names}, step=step)
    monkeypatch.setattr(Wavg, "algorithm", mirrored)
    with BagReader(REFERENCE) as reader:
        stepping = Replay(reader, mission_of_bag(REFERENCE, {}, (), None), [parse_request("wavg")], ())
        stepping.long_from = 0
        assert stepping.runs[0].stepper.offers_steps
        stepping.run(None)
    assert (len(called), stepping.runs[0].messages, stepping.runs[0].failures) == (STEPS, STEPS, 0)
