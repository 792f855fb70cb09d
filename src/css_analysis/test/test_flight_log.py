# SPDX-License-Identifier: Apache-2.0
"""Recordings come back as the columns that were written: own, foreign, incomplete and irregular ones."""

import numpy as np
import pytest
from presence import present
from scipy.spatial.transform import Rotation
from synthetic_flight import EPOCH_NS, columns, estimates, record, stamps, tilted, truth

from css_analysis.flight_log import angle, read_flight, to_body
from css_analysis.flight_topics import estimator_of
from css_common.codec import DecodeError, codec_of
from css_common.message_columns import Columns, columns_of, stack, stack_alike, unstack
from css_common.mission import load_mission
from css_msgs.msg import ControlStatus, CssVoltages, SpacecraftState, SunEstimate, WheelState
from css_recording.bag_metadata import Topic
from css_recording.bag_writer import BagWriter
from css_recording.errors import BagError

STEPS = 25


@pytest.fixture
def rng():
    """Numbers of this test alone: they do not depend on which others run."""
    return np.random.default_rng(1)


def random_columns(rng, message_type: type, steps: int = STEPS) -> Columns:
    """Columns with random numbers of each field's kind."""
    result = columns(message_type, stamps(steps))
    for name, values in vars(result).items():
        if name != "stamp_ns":
            values[...] = (
                rng.integers(0, 2, values.shape) if values.dtype.kind != "f" else rng.normal(size=values.shape)
            )
    return result


def assert_equal(a: Columns, b: Columns) -> None:
    assert vars(a).keys() == vars(b).keys()
    for name, values in vars(a).items():
        np.testing.assert_array_equal(values, getattr(b, name), err_msg=name)


@pytest.mark.parametrize("frame", ["bus", "eci", "a_long_frame"])
@pytest.mark.parametrize("message_type", [SpacecraftState, SunEstimate, CssVoltages, WheelState, ControlStatus])
def test_the_stacked_view_equals_decoding_each_message(rng, message_type, frame):
    codec = codec_of(message_type)
    written = random_columns(rng, message_type)
    names = [field.name for field in codec.fields]
    data = [
        codec.encode(codec.sample(int(stamp), frame, **{n: getattr(written, n)[i] for n in names}))
        for i, stamp in enumerate(written.stamp_ns)
    ]
    assert_equal(stack(codec, data), written)
    assert_equal(columns_of(codec, [codec.decode(d) for d in data]), written)
    assert unstack(codec, frame, written) == data


def test_a_number_that_the_type_does_not_hold_is_refused():
    many = columns(SunEstimate, stamps(3))
    vars(many)["mode"] = np.array([0, 1, 256])
    with pytest.raises(ValueError, match=r"SunEstimate.mode: a number given that uint8 does not hold"):
        unstack(codec_of(SunEstimate), "bus", many)
    vars(many)["mode"] = np.zeros((3, 2), np.uint8)
    with pytest.raises(ValueError, match=r"SunEstimate.mode: rows of \(2,\) given, expected \(\)"):
        unstack(codec_of(SunEstimate), "bus", many)


def test_messages_of_two_frames_are_not_alike():
    codec = codec_of(CssVoltages)
    messages = [codec.encode(codec.sample(EPOCH_NS, frame, voltages=np.ones(2))) for frame in ("bus", "eci")]
    assert stack_alike(codec, messages) is None
    first = stack_alike(codec, messages[:1])
    assert first is not None and first.frame_id == "bus"


def test_messages_of_different_length_are_padded():
    codec = codec_of(CssVoltages)
    samples = [codec.sample(EPOCH_NS + i, "bus", voltages=np.ones(n)) for i, n in enumerate((3, 1, 2))]
    result = stack(codec, [codec.encode(s) for s in samples])
    np.testing.assert_array_equal(np.isnan(result.voltages), [[0, 0, 0], [0, 1, 1], [0, 0, 1]])


def test_equal_length_with_different_layout_is_noticed():
    codec = codec_of(WheelState)
    a = codec.encode(codec.sample(EPOCH_NS, "bus", speed=np.ones(2), torque=np.full(1, 3.0)))
    b = codec.encode(codec.sample(EPOCH_NS, "bus", speed=np.ones(1), torque=np.full(2, 3.0)))
    assert len(a) == len(b)
    result = stack(codec, [a, b])
    np.testing.assert_array_equal(result.speed, [[1.0, 1.0], [1.0, np.nan]])
    np.testing.assert_array_equal(result.torque, [[3.0, np.nan], [3.0, 3.0]])


@pytest.mark.parametrize(
    "damage", [lambda d: d[:-9], lambda d: b"\0\0" + d[2:], lambda d: d[:8] + b"\xff" * 4 + d[12:]]
)
def test_damaged_messages_are_refused(damage):
    codec = codec_of(SunEstimate)
    good = codec.encode(codec.sample(EPOCH_NS, "bus"))
    for messages in ([damage(good)], [good, damage(good)]):
        with pytest.raises(DecodeError):
            stack(codec, messages)


def test_no_messages_are_empty_columns():
    assert len(stack(codec_of(SunEstimate), [])) == 0


def test_body_vectors_against_scipy(rng):
    sigma_bn = rng.normal(size=(50, 3)) * 0.3
    vectors_n = rng.normal(size=(50, 3))
    expected = Rotation.from_mrp(sigma_bn).inv().apply(vectors_n)
    np.testing.assert_allclose(to_body(sigma_bn, vectors_n), expected, atol=1e-14)


def test_angles_are_accurate_at_both_ends():
    z = np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(angle(tilted([1e-7, 30.0, 180.0 - 1e-7]), z), np.radians([1e-7, 30.0, 180.0 - 1e-7]))


def full_recording(rng, folder):
    sun_b = tilted(np.linspace(0.0, 40.0, STEPS))
    topics = {
        "/truth": (SpacecraftState, truth(np.linspace(0.0, 40.0, STEPS))),
        "/css/voltages": (CssVoltages, random_columns(rng, CssVoltages)),
        "/ekf/sun_estimate": (SunEstimate, estimates(sun_b, rate_source=1)),
        "/wavg/sun_estimate": (SunEstimate, estimates(sun_b)),
        "/wheels/state": (WheelState, random_columns(rng, WheelState)),
        "/control/status": (ControlStatus, random_columns(rng, ControlStatus)),
    }
    return topics, folder


def test_a_recording_comes_back(rng, tmp_path):
    topics, folder = full_recording(rng, tmp_path / "flight")
    log = read_flight(record(folder, topics))
    assert list(log.estimates) == ["ekf", "wavg"]
    for topic, attribute in {
        "/truth": "truth",
        "/wheels/state": "wheels",
        "/control/status": "control",
    }.items():
        assert_equal(getattr(log, attribute), topics[topic][1])
    assert_equal(log.estimates["ekf"], topics["/ekf/sun_estimate"][1])
    assert log.torque_command is None
    assert log.flown is None, "a recording without its mission does not say who flew"
    assert log.uses_gyro("ekf") and not log.uses_gyro("wavg")
    assert log.period == pytest.approx(0.1)
    assert log.time(present(log.truth))[-1] == pytest.approx((STEPS - 1) * 0.1)
    np.testing.assert_allclose(np.degrees(log.pointing_error), np.linspace(0.0, 40.0, STEPS), atol=1e-12)


def test_the_recorded_mission_tells_who_flew(rng, tmp_path):
    topics, folder = full_recording(rng, tmp_path / "flight")
    mission = load_mission("okeefe_2013").with_overrides(["mission.epoch=2013-05-31T23:59:00Z"])
    log = read_flight(record(folder, topics, mission=mission.text()))
    assert log.flown == "ekf"
    assert log.name == "okeefe_2013"
    assert log.time(present(log.truth))[0] == pytest.approx(60.0)


def test_an_invalid_mission_leaves_the_data_readable(rng, tmp_path):
    topics, folder = full_recording(rng, tmp_path / "flight")
    log = read_flight(record(folder, topics, mission="/**: {ros__parameters: {mission: {nmae: x}}}"))
    assert log.mission is None and len(present(log.truth)) == STEPS
    assert "nmae" in log.notes[0] and "\n" not in log.notes[0]


def test_foreign_names_are_recognised_by_type(rng, tmp_path):
    topics, folder = full_recording(rng, tmp_path / "flight")
    foreign = {
        "/sat7/obc/sun_estimate": topics["/ekf/sun_estimate"],
        "/sat7/heading": topics["/wavg/sun_estimate"],
        "/sat7/cells": topics["/css/voltages"],
    }
    log = read_flight(record(folder, foreign))
    assert log.truth is None and log.control is None
    assert set(log.estimates) == {"sat7/obc", "sat7/heading"}
    assert_equal(present(log.voltages), topics["/css/voltages"][1])
    assert log.epoch_ns == EPOCH_NS


def test_remapped_topics(rng, tmp_path):
    topics, folder = full_recording(rng, tmp_path / "flight")
    log = read_flight(record(folder, topics), remap={"/ekf/sun_estimate": "/flight/sun_estimate"})
    assert set(log.estimates) == {"flight", "wavg"}


def test_a_second_truth_is_left_out_with_a_note(rng, tmp_path):
    topics, folder = full_recording(rng, tmp_path / "flight")
    log = read_flight(record(folder, {"/other": (SpacecraftState, random_columns(rng, SpacecraftState, 3))} | topics))
    assert len(present(log.truth)) == STEPS
    assert log.notes == ["of several topics with SpacecraftState one is taken, /truth if it is there"]


def test_repeated_stamps_keep_the_later_answer():
    log = estimates(tilted([0.0, 1.0, 2.0]))
    log.stamp_ns = log.stamp_ns[[1, 0, 0]]
    result = log.sorted()
    np.testing.assert_allclose(result.sun_b, tilted([2.0, 0.0]))


def test_recordings_without_flight_data_are_refused(tmp_path):
    with BagWriter(tmp_path / "other", [Topic("/tick", "std_msgs/msg/Header")]) as writer:
        writer.write("/tick", 1, b"\0\1\0\0" + bytes(16))
    with pytest.raises(BagError, match="holds no truth"):
        read_flight(tmp_path / "other")
    with pytest.raises(BagError, match="no such recording"):
        read_flight(tmp_path / "absent")


def test_names_of_estimators():
    assert estimator_of("/ekf/sun_estimate") == "ekf"
    assert estimator_of("/sun_estimate") == "sun_estimate"


def test_stamps_of_other_clocks_belong_to_the_nearest_step(rng, tmp_path):
    topics, folder = full_recording(rng, tmp_path / "flight")
    log = read_flight(record(folder, topics))
    shifted = estimates(tilted(np.zeros(STEPS)))
    shifted.stamp_ns = shifted.stamp_ns + 30_000_000
    rows, steps = log.truth_rows(shifted)
    np.testing.assert_array_equal(rows, steps)
    shifted.stamp_ns = shifted.stamp_ns + 10**12
    assert len(log.truth_rows(shifted)[0]) == 0


def test_a_damaged_message_costs_itself_alone_and_is_noted(tmp_path):
    codec = codec_of(SunEstimate)
    written = [codec.encode(codec.sample(EPOCH_NS + i, "bus", nis=float(i))) for i in range(5)]
    with BagWriter(tmp_path / "bag", [Topic("/ekf/sun_estimate", "css_msgs/msg/SunEstimate")]) as writer:
        for i, data in enumerate(written):
            writer.write("/ekf/sun_estimate", EPOCH_NS + i, {1: data[:-9], 3: b"\0\0" + data[2:]}.get(i, data))
    log = read_flight(tmp_path / "bag")
    np.testing.assert_array_equal(log.estimates["ekf"].nis, [0.0, 2.0, 4.0])
    assert any("1 of 4 messages left out" in note for note in log.notes)
    assert any("/ekf/sun_estimate: 1 message at" in note and "big-endian" in note for note in log.notes)
