# SPDX-License-Identifier: Apache-2.0
"""What rosbag2 of Jazzy needs of a recording, requirement by requirement.

Sources: ros2/rosbag2, `rosbag2_storage_mcap/src/mcap_storage.cpp` and `rosbag2_storage/yaml.hpp`; the MCAP
specification. rosbag2 itself is not among the wheels that Sunpoint installs.
"""

import hashlib
import json

import pytest
import yaml
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Chunk, MessageIndex
from mcap.stream_reader import StreamReader
from presence import present
from rosbags.rosbag2 import Reader

from css_recording.bag_metadata import QosProfile, Topic, parse_qos, read_metadata
from css_recording.bag_reader import BagReader
from css_recording.bag_writer import BagWriter
from css_recording.recovery import recover
from css_recording.schemas import schema_of
from css_recording.split_bag_writer import FileLimits, SplitBagWriter

QOS = QosProfile("best_effort", "transient_local", "keep_last", 7)


@pytest.fixture(scope="module")
def recording(flight, tmp_path_factory):
    folder = tmp_path_factory.mktemp("layout") / "orbit_7"
    topics = [flight.topics[0]._replace(qos=(QOS,)), *flight.topics[1:]]
    with BagWriter(folder, topics, {"mission": "x", "numba": "1"}) as writer:
        for message in flight.messages(45):
            writer.write(*message)
    return folder


@pytest.fixture(scope="module")
def summary(recording):
    with (recording / "orbit_7_0.mcap").open("rb") as file:
        return make_reader(file).get_summary()


@pytest.fixture(scope="module")
def information(recording):
    return yaml.safe_load((recording / "metadata.yaml").read_text())["rosbag2_bagfile_information"]


def file_metadata(recording, name):
    with (recording / "orbit_7_0.mcap").open("rb") as file:
        return [record.metadata for record in make_reader(file).iter_metadata() if record.name == name]


def test_folder_holds_the_two_files_of_a_rosbag2_recording(recording):
    assert sorted(path.name for path in recording.iterdir()) == ["metadata.yaml", "orbit_7_0.mcap"]


def test_profile_is_ros2(recording):
    with (recording / "orbit_7_0.mcap").open("rb") as file:
        assert make_reader(file).get_header().profile == "ros2"


def test_statistics_exist_and_are_right(summary):
    # mcap_storage.cpp takes .value() of the statistics without looking
    statistics = summary.statistics
    assert statistics.message_count == 3 * 45
    assert set(statistics.channel_message_counts.values()) == {45}
    assert statistics.message_end_time - statistics.message_start_time == 44 * 100_000_000
    assert statistics.metadata_count == len(summary.metadata_indexes) == 2


def test_every_channel_has_a_schema_in_ros2msg_and_says_cdr(summary):
    assert len(summary.channels) == 3
    for channel in summary.channels.values():
        schema = summary.schemas[channel.schema_id]
        assert channel.message_encoding == "cdr"
        assert schema.encoding == "ros2msg"
        assert schema.data.decode() == schema_of(schema.name).text
        assert "=" * 80 + "\nMSG: std_msgs/Header\n" in schema.data.decode()


def test_channels_carry_quality_of_service_and_type_hash(summary):
    for channel in summary.channels.values():
        type_name = summary.schemas[channel.schema_id].name
        assert channel.metadata["topic_type_hash"] == schema_of(type_name).type_hash
        profiles = yaml.safe_load(channel.metadata["offered_qos_profiles"])
        assert isinstance(profiles, list)
        expected = QOS if channel.topic == "/css/voltages" else QosProfile()
        assert parse_qos(channel.metadata["offered_qos_profiles"]) == (expected,)
        # to_rclcpp_qos_vector reads each of these with .as<>() and throws when one is missing
        assert set(profiles[0]) == {
            "history", "depth", "reliability", "durability", "deadline", "lifespan", "liveliness",
            "liveliness_lease_duration", "avoid_ros_namespace_conventions",
        }  # fmt: skip
        assert profiles[0]["deadline"] == {"sec": 9223372036, "nsec": 854775807}


def test_serialized_metadata_is_there_once_and_says_the_same_as_the_yaml_file(recording, information):
    # without it the reader assumes version 8 and fails on the quality of service of version 9
    (record,) = file_metadata(recording, "rosbag2")
    assert yaml.safe_load(record["serialized_metadata"]) == information


def test_metadata_have_every_field_of_version_9(information):
    assert set(information) == {
        "version", "storage_identifier", "duration", "starting_time", "message_count",
        "topics_with_message_count", "compression_format", "compression_mode", "relative_file_paths", "files",
        "custom_data", "ros_distro",
    }  # fmt: skip
    assert information["version"] == 9
    assert information["storage_identifier"] == "mcap"
    assert information["relative_file_paths"] == ["orbit_7_0.mcap"]
    assert information["compression_format"] == information["compression_mode"] == ""
    assert information["ros_distro"] == "jazzy"
    (file,) = information["files"]
    assert file["path"] == "orbit_7_0.mcap"
    assert file["message_count"] == information["message_count"] == 3 * 45
    assert file["duration"] == information["duration"]


def test_times_are_those_of_the_file(summary, information):
    start = information["starting_time"]["nanoseconds_since_epoch"]
    assert start == summary.statistics.message_start_time
    assert start + information["duration"]["nanoseconds"] == summary.statistics.message_end_time


def test_topics_agree_with_the_channels(summary, information):
    topics = {entry["topic_metadata"]["name"]: entry for entry in information["topics_with_message_count"]}
    assert set(topics) == {channel.topic for channel in summary.channels.values()}
    for channel in summary.channels.values():
        entry = topics[channel.topic]
        assert entry["message_count"] == summary.statistics.channel_message_counts[channel.id]
        assert entry["topic_metadata"]["serialization_format"] == "cdr"
        assert entry["topic_metadata"]["type"] == summary.schemas[channel.schema_id].name
        assert entry["topic_metadata"]["type_description_hash"] == channel.metadata["topic_type_hash"]
        assert entry["topic_metadata"]["offered_qos_profiles"] == yaml.safe_load(
            channel.metadata["offered_qos_profiles"]
        )


def test_yaml_has_no_anchors(recording):
    text = (recording / "metadata.yaml").read_text()
    assert "&" not in text and "*" not in text


def test_chunks_are_compressed_by_spans_of_time_and_indexed(recording, summary):
    assert len(summary.chunk_indexes) == 6  # 4.5 s in spans of 0.8 s
    for index in summary.chunk_indexes:
        assert index.compression == "zstd"
        assert index.message_index_length > 0
        assert index.message_start_time // (8 * 10**8) == index.message_end_time // (8 * 10**8)
        assert len(index.message_index_offsets) == 3
    with (recording / "orbit_7_0.mcap").open("rb") as file:
        records = list(StreamReader(file, emit_chunks=True).records)
    chunks = [record for record in records if isinstance(record, Chunk)]
    indexed = sum(len(record.records) for record in records if isinstance(record, MessageIndex))
    assert len(chunks) == 6
    assert indexed == 3 * 45


def test_messages_stand_in_log_time_order_with_running_sequence_numbers(recording):
    with (recording / "orbit_7_0.mcap").open("rb") as file:
        seen = [
            (message.log_time, channel.id, message.sequence)
            for _, channel, message in NonSeekingReader(file).iter_messages(log_time_order=False)
        ]
    assert seen == sorted(seen)
    for channel_id in (1, 2, 3):
        assert [sequence for _, channel, sequence in seen if channel == channel_id] == list(range(1, 46))


def test_mission_and_versions_are_in_the_file(recording):
    (entries,) = file_metadata(recording, "sunpoint")
    sums = {key: hashlib.sha256(value.encode()).hexdigest() for key, value in (("mission", "x"), ("numba", "1"))}
    assert json.loads(entries.pop("sha256")) == sums
    assert entries == {"mission": "x", "numba": "1"}


def test_notes_made_at_the_end_are_in_the_file_and_in_the_custom_data(flight, tmp_path):
    with BagWriter(tmp_path / "bag", flight.topics, {"mission": "x"}) as writer:
        writer.close({"messages_lost": "3", "mission": "y"})
    expected = {"messages_lost": "3", "mission": "y"}
    with writer.path.open("rb") as file:
        records = {record.name: record.metadata for record in make_reader(file).iter_metadata()}
    assert {**records["sunpoint_flight"], **expected, "sha256": ""} == {**expected, "sha256": ""}
    assert yaml.safe_load(records["rosbag2"]["serialized_metadata"])["custom_data"] == expected
    information = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())
    assert information["rosbag2_bagfile_information"]["custom_data"] == expected
    with Reader(tmp_path / "bag") as reader:
        assert reader.storage.metadata.custom == expected
    with BagReader(tmp_path / "bag") as reader:
        assert reader.description == {"mission": "x", "messages_lost": "3"}
    (tmp_path / "bag" / "metadata.yaml").unlink()
    recover(tmp_path / "bag")
    with Reader(tmp_path / "bag") as reader:
        assert reader.storage.metadata.custom == expected


@pytest.mark.parametrize(
    "text",
    [
        "[" * 20_000,
        "{a: " * 20_000,
        "- " * 20_000,
        "a: " * 20_000,
        "!!python/object:os.system x",
        "\0",
        "a: 2001-99-99",
    ],
)
def test_metadata_that_are_none_are_taken_for_missing(tmp_path, text):
    (tmp_path / "metadata.yaml").write_text(text)
    assert read_metadata(tmp_path) is None
    assert parse_qos(text) == ()


def test_a_bare_file_carries_everything_the_yaml_file_says(recording, information, tmp_path):
    # so that rosbag2's reindex loses nothing when metadata.yaml is gone
    (record,) = file_metadata(recording, "rosbag2")
    assert (
        yaml.safe_load(record["serialized_metadata"])["topics_with_message_count"]
        == (information["topics_with_message_count"])
    )


def test_stamps_before_1970_are_refused(flight, tmp_path):
    from css_recording.errors import BagError

    with BagWriter(tmp_path / "bag", flight.topics) as writer, pytest.raises(BagError, match="before 1970"):
        writer.write("/css/voltages", -1, b"\0\1\0\0")


def test_two_topics_of_one_type_share_a_schema(flight, tmp_path):
    topics = [Topic("a", flight.topics[0].type), Topic("/b", flight.topics[0].type)]
    with BagWriter(tmp_path / "bag", topics) as writer:
        pass
    with writer.path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert len(present(summary).schemas) == 1
    assert sorted(channel.topic for channel in present(summary).channels.values()) == ["/a", "/b"]


@pytest.mark.parametrize("files", [None, FileLimits(), FileLimits(longest_ns=3 * 10**9)])
def test_times_of_a_recording_whose_last_and_first_messages_came_late(flight, tmp_path, files):
    """The span of a recording is that of its messages, whichever batch brings them last."""
    folder = tmp_path / "late"
    messages = flight.messages(45)
    # some of the middle come at the end, and the very first ones after five steps
    arrival = [*messages[9:60], *messages[:9], *messages[66:], *messages[60:66]]
    writer = BagWriter(folder, flight.topics) if files is None else SplitBagWriter(folder, flight.topics, files=files)
    with writer:
        for message in arrival:
            writer.write(*message)
            if message == messages[66]:
                writer.flush()
    first_ns, last_ns = messages[0][1], messages[-1][1]
    information = yaml.safe_load((folder / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert information["starting_time"]["nanoseconds_since_epoch"] == first_ns
    assert information["duration"]["nanoseconds"] == last_ns - first_ns
    spans = []
    for path in sorted(folder.glob("*.mcap")):
        with path.open("rb") as file:
            reader = make_reader(file)
            statistics = present(reader.get_summary()).statistics
            stamps = [message.log_time for _, _, message in reader.iter_messages()]
            chunks = present(reader.get_summary()).chunk_indexes
        spans.append((present(statistics).message_start_time, present(statistics).message_end_time))
        assert spans[-1] == (min(stamps), max(stamps))
        assert min(c.message_start_time for c in chunks) == min(stamps)
        assert max(c.message_end_time for c in chunks) == max(stamps)
    assert (min(s for s, _ in spans), max(e for _, e in spans)) == (first_ns, last_ns)
    of_files = [
        (file["starting_time"]["nanoseconds_since_epoch"], file["duration"]["nanoseconds"])
        for file in information["files"]
    ]
    assert of_files == [(start, end - start) for start, end in spans]
