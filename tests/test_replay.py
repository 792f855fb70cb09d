# SPDX-License-Identifier: Apache-2.0
"""Replay: the bytes that flew, other estimators on the same cells, foreign recordings, the reference recording."""

import json
import platform
from pathlib import Path

import numpy as np
import pytest
from flights import fly_composed, messages_by_topic, samples, short_mission
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from css_bringup.flight_pages import write_replay_page
from css_bringup.replay_bag import mission_of_bag, replay
from css_bringup.replay_pass import parse_request
from css_common.codec import codec_of
from css_common.mission_file import MissionError
from css_msgs.msg import CssVoltages, SunEstimate
from css_recording.bag_metadata import Topic
from css_recording.bag_reader import BagReader
from css_recording.bag_writer import BagWriter
from css_recording.provenance import software_versions
from css_report.flight_page import flight_page, read_for_page
from css_report.html_page import html_of
from css_report.places import page_of

REFERENCE = Path(__file__).parents[1] / "bags" / "reference"


@pytest.fixture(scope="module")
def flight(tmp_path_factory) -> Path:
    bag = tmp_path_factory.mktemp("flight") / "bag"
    assert fly_composed(short_mission(60.0), bag).messages_lost == 0
    return bag


def _replayed(source: Path, out: Path, *requests: str, remap=None, name=None):
    remap = remap or {}
    mission = mission_of_bag(source, remap, [], name)
    return replay(source, out, mission, [parse_request(text) for text in requests], remap)


def test_the_estimator_that_flew_gives_the_bytes_that_flew(flight, tmp_path):
    result = _replayed(flight, tmp_path / "replay", "ekf")
    comparison = result.replayed[0].comparison
    assert comparison.compared == 600
    assert comparison.identical
    assert messages_by_topic(tmp_path / "replay")["/ekf/sun_estimate"] == messages_by_topic(flight)["/ekf/sun_estimate"]


def test_one_pass_serves_any_set_of_estimators(flight, tmp_path):
    result = _replayed(flight, tmp_path / "replay", "wavg", "wavg:gyro=off", "ekf", "ekf:gyro=off")
    assert [(run["estimator"], run["gyro"], run["flown"]) for run in result.runs] == [
        ("wavg", "on", False),
        ("wavg", "off", False),
        ("ekf", "on", True),
        ("ekf", "off", False),
    ]
    assert result.messages == 4 * 600
    without = samples(tmp_path / "replay", "/ekf_gyro_off/sun_estimate", SunEstimate)
    assert SunEstimate.RATE_GYRO not in {s.rate_source for s in without}
    # each replay of its own gives the same as all together
    alone = _replayed(flight, tmp_path / "alone", "wavg:gyro=off")
    assert alone.messages == 600
    together = messages_by_topic(tmp_path / "replay")["/wavg_gyro_off/sun_estimate"]
    assert messages_by_topic(tmp_path / "alone")["/wavg_gyro_off/sun_estimate"] == together


def test_another_parameter_is_another_estimate(flight, tmp_path):
    result = _replayed(flight, tmp_path / "replay", "wavg", "wavg:gate=0.9")
    first, second = (messages_by_topic(tmp_path / "replay")[f"/{run.label}/sun_estimate"] for run in result.replayed)
    assert result.replayed[1].comparison is None
    assert first != second
    assert [run["estimator"] for run in result.runs] == ["wavg", "wavg:gate=0.9"]


@pytest.mark.parametrize(
    "request_text", ["nonsense", "ekf:gyro=maybe", "ekf:gate", "ekf:no_such_key=1", "ekf:use_gyro=2", "gyro"]
)
def test_what_cannot_be_replayed_is_refused_in_one_line(flight, tmp_path, request_text):
    with pytest.raises(MissionError) as caught:
        _replayed(flight, tmp_path / "replay", request_text)
    assert "\n" not in str(caught.value)


def test_a_gyro_is_switched_for_estimators_that_use_one(flight, tmp_path):
    with pytest.raises(MissionError, match=r"^estimator triad: gyro given, but it uses none"):
        _replayed(flight, tmp_path / "replay", "triad:gyro=off")


def test_sqlite_recording_with_other_topic_names(flight, tmp_path):
    store = get_typestore(Stores.ROS2_JAZZY)
    definition = "std_msgs/Header header\nuint32 saturated\nfloat64[] voltages\n"
    store.register(get_types_from_msg(definition, "css_msgs/msg/CssVoltages"))
    sqlite = Writer(tmp_path / "foreign", version=9, storage_plugin=StoragePlugin.SQLITE3)
    with BagReader(flight) as reader, sqlite as out:
        connections = {
            "/css/voltages": out.add_connection("/obc/adc/sun", "css_msgs/msg/CssVoltages", typestore=store),
            "/gyro/imu": out.add_connection("/obc/imu", "sensor_msgs/msg/Imu", typestore=store),
        }
        for message in reader.messages(list(connections)):
            out.write(connections[message.topic], message.stamp_ns, message.data)
    remap = {"/obc/adc/sun": "/css/voltages", "/obc/imu": "/gyro/imu"}
    with pytest.raises(MissionError, match=r"holds no mission.*--mission NAME"):
        _replayed(tmp_path / "foreign", tmp_path / "replay", "ekf", remap=remap)
    foreign = _replayed(tmp_path / "foreign", tmp_path / "replay", "ekf", "wavg", remap=remap, name="okeefe_2013")
    # the mission is the one that flew, so the estimates are those of the flight
    assert messages_by_topic(tmp_path / "replay")["/ekf/sun_estimate"] == messages_by_topic(flight)["/ekf/sun_estimate"]
    assert all(run["heading_error_mean_deg"] is None for run in foreign.runs)


def test_without_its_inputs_the_error_names_what_there_is(flight, tmp_path):
    with pytest.raises(MissionError, match=r"needs css/voltages; the recording has .*/cells.*--remap"):
        _replayed(flight, tmp_path / "replay", "ekf", remap={"/css/voltages": "/cells"})


def test_damaged_messages_are_counted_and_passed_over(flight, tmp_path):
    codec = codec_of(CssVoltages)
    with BagReader(flight) as reader, BagWriter(tmp_path / "damaged", metadata=reader.description) as writer:
        for entry in reader.topics:
            writer.add_topic(Topic(entry.topic.name, entry.topic.type))
        for number, message in enumerate(reader.messages()):
            data = message.data
            if message.topic == "/css/voltages" and number % 10 == 0:
                sample = codec.decode(data)
                sample.voltages = np.full(8, np.nan)
                data = codec.encode(sample)
            writer.write(message.topic, message.stamp_ns, data)
    result = _replayed(tmp_path / "damaged", tmp_path / "replay", "ekf")
    refused = result.rejected["/css/voltages"]["not_finite"]
    assert refused > 10
    assert result.replayed[0].messages == 600 - refused
    # its page says so beside what the flight says of itself, and so does one that is made of the recording later
    assert write_replay_page(result) == page_of(tmp_path / "replay")
    for page in (page_of(tmp_path / "replay").read_text(), html_of(flight_page(read_for_page(tmp_path / "replay")))):
        assert "In flight nothing was refused" in page
        assert "In the replay, as its estimators counted it:" in page
        assert f"{refused} messages of /css/voltages refused (not_finite)" in page
        assert "css/voltages: not_finite:" in page


def test_a_replay_of_a_whole_flight_says_that_nothing_was_refused(flight, tmp_path):
    result = _replayed(flight, tmp_path / "replay", "wavg")
    assert result.incidents == []
    page = html_of(flight_page(read_for_page(tmp_path / "replay")))
    assert "In the replay nothing was refused" in page and "In flight nothing was refused" in page


def test_reference_recording_gives_the_stored_numbers(tmp_path):
    stored = json.loads((REFERENCE / "expected.json").read_text())
    result = _replayed(REFERENCE, tmp_path / "replay", *stored["estimators"])
    for run, expected in zip(result.runs, stored["runs"], strict=True):
        for key, value in expected.items():
            assert run[key] == (pytest.approx(value, abs=1e-6) if isinstance(value, float) else value), key
    with BagReader(REFERENCE) as reader:
        flown_on = reader.description
    here = software_versions()
    same = all(here.get(key) == flown_on.get(key) for key in ("cpu", "python", "numba", "numpy", "lock_sha256"))
    comparison = next(run.comparison for run in result.replayed if run.comparison is not None)
    assert comparison.compared > 0 and comparison.unmatched == 0
    if same and platform.system() == "Linux":
        assert comparison.identical
