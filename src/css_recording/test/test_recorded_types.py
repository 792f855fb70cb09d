# SPDX-License-Identifier: Apache-2.0
"""A recorded type is read as the installed one only where it is that, or converts to it field by field."""

import numpy as np
import pytest
from presence import present
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter

from css_common.codec import codec_of
from css_msgs.msg import CssVoltages
from css_recording.bag_metadata import Topic
from css_recording.bag_reader import BagReader
from css_recording.bag_writer import BagWriter
from css_recording.errors import BagError
from css_recording.recorded_types import match_type
from css_recording.schemas import MessageSchema, hash_of, schema_of, store_of, types_of

CELLS = "css_msgs/msg/CssVoltages"
INSTALLED = schema_of(CELLS)
HEADER = INSTALLED.text[INSTALLED.text.index("=" * 80) :]


def recorded(fields: str, **changes) -> MessageSchema:
    """A definition of the type of the cells with other fields."""
    text = f"std_msgs/Header header\n{fields}\n{HEADER}"
    return MessageSchema(CELLS, text, hash_of(CELLS, text))._replace(**changes)


def nested(depth: int) -> str:
    """A definition of a few lines that has twenty fields to the power of its depth."""
    parts = ["T0 field\n"]
    for level in range(depth):
        fields = "".join(f"T{level + 1} f{number}\n" for number in range(20))
        parts.append(f"{'=' * 80}\nMSG: css_msgs/T{level}\n{fields}")
    return "".join([*parts, f"{'=' * 80}\nMSG: css_msgs/T{depth}\nbool end\n"])


def match(schema: MessageSchema | None, type_name: str = CELLS, expected: str = CELLS):
    return match_type(Topic("/css/voltages", type_name, (), schema), expected)


def test_the_installed_type_is_taken_as_it_is():
    assert match(INSTALLED) == ("", None)
    assert match(INSTALLED._replace(type_hash="")) == ("", None)
    assert match(INSTALLED._replace(text="")) == ("", None)  # the hash alone tells
    assert match(INSTALLED, "css_msgs/CssVoltages") == ("", None)
    assert match(INSTALLED._replace(text=INSTALLED.text + "# a remark\n")) == ("", None)


def test_another_type_is_refused_by_name():
    with pytest.raises(
        BagError, match="topic /css/voltages is css_msgs/msg/WheelState, expected css_msgs/msg/CssVoltages"
    ):
        match(None, "css_msgs/WheelState")


def test_what_cannot_be_compared_is_said_or_refused():
    assert "without hash and definition, taken for the css_msgs/msg/CssVoltages of here" in match(None).note
    other = "RIHS01_" + "0" * 64
    with pytest.raises(BagError, match=f"hash {other}, here it has {INSTALLED.type_hash}.*no definition"):
        match(MessageSchema(CELLS, "", other))
    with pytest.raises(BagError, match="cannot be understood"):
        match(INSTALLED._replace(text="{ % }", type_hash=other))
    for text in (
        "std_msgs/Header header\nfloat6t[] voltages\n",  # one flipped bit
        f"css_msgs/CssVoltages[] again\n{HEADER}",
        nested(8),
    ):
        with pytest.raises(BagError, match="cannot be understood"):
            match(INSTALLED._replace(text=text, type_hash=other))
    same_fields = match(INSTALLED._replace(text=INSTALLED.text + "\n", type_hash=other))
    assert same_fields.conversion is None and "another hash" in same_fields.note


@pytest.mark.parametrize(
    ("fields", "difference"),
    [
        ("uint32 saturated", "it lacks voltages"),
        ("float64[] volts\nuint32 saturated", "it lacks voltages"),
        ("float32[] voltages\nuint32 saturated", r"voltages is float32\[\], here float64\[\]"),
        ("float64[8] voltages\nuint32 saturated", r"voltages is float64\[8\], here float64\[\]"),
        ("float64[] voltages\nint32 saturated", "saturated is int32, here uint32"),
    ],
)
def test_fields_that_are_missing_or_of_another_type_are_named(fields, difference):
    with pytest.raises(BagError, match=f"topic /css/voltages: .*another definition: .*{difference}"):
        match(recorded(fields))


def test_constants_that_mean_something_else_are_refused():
    text = schema_of("css_msgs/msg/SunEstimate").text
    changed = text.replace("VALIDITY_VALID = 2", "VALIDITY_VALID = 1").replace("VALIDITY_VALID=2", "VALIDITY_VALID=1")
    assert changed != text
    topic = Topic("/s", "css_msgs/msg/SunEstimate", (), schema_of("css_msgs/msg/SunEstimate")._replace(text=changed))
    with pytest.raises(BagError, match="VALIDITY_VALID = 1, here 2"):
        match_type(topic, topic.type)


def fields_in_the_other_order() -> str:
    lines = [line for line in INSTALLED.text.split("=" * 80)[0].splitlines() if line.split("#")[0].strip()]
    names = [" ".join(line.split("#")[0].split()) for line in lines]
    return "\n".join(["float64 temperature", *reversed([name for name in names if "Header" not in name])])


@pytest.fixture
def other_order(flight, tmp_path):
    """A recording of cells whose definition has another order and a field more, and what its messages say."""
    schema = recorded(fields_in_the_other_order())
    store = store_of(types_of(schema))
    header = store.types["std_msgs/msg/Header"]
    time = store.types["builtin_interfaces/msg/Time"]
    with BagWriter(tmp_path / "bag", [Topic("/css/voltages", CELLS, schema=schema)]) as writer:
        for step in range(5):
            message = store.types[CELLS](
                temperature=273.0 + step,
                header=header(stamp=time(sec=7 + step, nanosec=5), frame_id="bus"),
                saturated=step,
                voltages=np.linspace(0.1, 0.9, 8) * step,
            )
            writer.write("/css/voltages", (7 + step) * 10**9 + 5, bytes(store.serialize_cdr(message, CELLS)))
        writer.write("/css/voltages", 13 * 10**9, b"\0\1\0\0\1\2")
    return tmp_path / "bag"


def test_messages_are_converted_by_field_names(other_order):
    codec = codec_of(CssVoltages)
    with BagReader(other_order) as reader:
        samples = [codec.decode(m.data) for m in reader.messages(["/css/voltages"])]
        (note,) = reader.notes
        (refused,) = reader.refused
    assert "converted by field names, without its temperature" in note
    assert (refused.count, refused.first_ns) == (1, 13 * 10**9)
    assert [(s.stamp_ns, s.frame_id, s.saturated) for s in samples] == [
        ((7 + step) * 10**9 + 5, "bus", step) for step in range(5)
    ]
    for step, sample in enumerate(samples):
        np.testing.assert_array_equal(sample.voltages, np.linspace(0.1, 0.9, 8) * step)


def test_a_topic_of_another_definition_is_refused_and_the_others_are_read(flight, tmp_path):
    topics = [Topic("/css/voltages", CELLS, schema=recorded("float32[] voltages")), *flight.topics[1:]]
    with BagWriter(tmp_path / "bag", topics) as writer:
        for message in flight.messages(3):
            writer.write(*message)
    with BagReader(tmp_path / "bag") as reader:
        assert len(list(reader.messages(["/gyro/imu"]))) == 3
        with pytest.raises(BagError, match=r"topic /css/voltages: .*float32"):
            next(reader.messages(["/css/voltages"]))
        with pytest.raises(BagError, match="topic /gyro/imu is sensor_msgs/msg/Imu, expected css_msgs/msg/WheelState"):
            reader.expect({"/gyro/imu": "css_msgs/WheelState", "/not/recorded": "css_msgs/WheelState"})


def test_sqlite_tables_and_metadata_tell_the_type_too(flight, tmp_path):
    with RosbagsWriter(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection("/css/voltages", CELLS, typestore=flight.typestore)
        writer.write(connection, 1, flight.messages(1)[0][2])
    with BagReader(tmp_path / "bag") as reader:
        (entry,) = reader.topics
    assert present(entry.topic.schema).type_hash == INSTALLED.type_hash
    assert present(entry.topic.schema).encoding == "ros2msg"
    assert "float64[] voltages" in present(entry.topic.schema).text


def test_a_hash_that_only_metadata_yaml_has_is_used(flight, tmp_path):
    other = "RIHS01_" + "1" * 64
    bare = MessageSchema(CELLS, "", "")
    with BagWriter(tmp_path / "bag", [Topic("/css/voltages", CELLS, schema=bare)]) as writer:
        writer.write(*flight.messages(1)[0])
    metadata = tmp_path / "bag" / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace("type_description_hash: ''", f"type_description_hash: {other}"))
    with BagReader(tmp_path / "bag") as reader, pytest.raises(BagError, match=other):
        next(reader.messages())
