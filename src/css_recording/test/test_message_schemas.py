# SPDX-License-Identifier: Apache-2.0
"""Definitions and type hashes of installed types agree with what `rosbags` computes by itself."""

from pathlib import Path

import pytest
from ament_index_python import get_package_share_directory
from mcap_ros2._dynamic import generate_dynamic
from rosbags.typesys import Stores, get_typestore

from css_recording.errors import BagError
from css_recording.schemas import dependencies, hash_of, schema_of, split_type_name

PACKAGES = ("css_msgs", "std_msgs", "geometry_msgs", "sensor_msgs", "rcl_interfaces", "diagnostic_msgs")
TYPES = sorted(
    f"{package}/msg/{path.stem}"
    for package in PACKAGES
    for path in Path(get_package_share_directory(package), "msg").glob("*.msg")
)


def test_the_messages_of_sunpoint_are_installed():
    assert "css_msgs/msg/CssVoltages" in TYPES
    assert len(TYPES) > 100


@pytest.mark.parametrize("package", PACKAGES)
def test_computed_hashes_are_the_installed_ones(package):
    # two implementations of RIHS01: rosidl wrote the one beside each definition, rosbags computes the other
    for type_name in TYPES:
        if type_name.startswith(f"{package}/"):
            schema = schema_of(type_name)
            assert schema.type_hash.startswith("RIHS01_")
            assert schema.type_hash == hash_of(type_name, schema.text), type_name


def test_dependencies_are_those_of_the_jazzy_definitions_of_rosbags():
    store = get_typestore(Stores.ROS2_JAZZY)
    for type_name in (
        "sensor_msgs/msg/Imu",
        "diagnostic_msgs/msg/DiagnosticArray",
        "geometry_msgs/msg/PoseStamped",
    ):
        text, _ = store.generate_msgdef(type_name, ros_version=2)

        def parts(text):
            return sorted(line for line in text.splitlines() if line.startswith("MSG: "))

        assert [part.replace("/msg/", "/") for part in parts(text)] == parts(schema_of(type_name).text)


def test_every_schema_is_complete_for_a_reader_of_mcap():
    for type_name in TYPES:
        assert type_name.replace("/msg/", "/") in {
            name.replace("/msg/", "/") for name in generate_dynamic(type_name, schema_of(type_name).text)
        }


def test_hash_is_computed_where_no_description_is_installed(monkeypatch):
    schema = schema_of("css_msgs/msg/SunEstimate")
    schema_of.cache_clear()
    monkeypatch.setattr("css_recording.schemas._installed_hash", lambda type_name: None)
    assert schema_of("css_msgs/msg/SunEstimate") == schema
    schema_of.cache_clear()


def test_dependencies_of_all_ways_to_write_a_field():
    text = """
    # std_msgs/Nothing
    int32 X=1   # a constant
    string<=10 name "a/b"
    float64[<=3] few
    Local one
    Local[4] again
    std_msgs/Header header
    other_msgs/msg/Thing[] things
    """
    assert dependencies("my_msgs/msg/Root", text) == [
        "my_msgs/msg/Local",
        "std_msgs/msg/Header",
        "other_msgs/msg/Thing",
    ]


@pytest.mark.parametrize("name", ["", "css_msgs", "css_msgs/CssVoltages", "css_msgs/srv/X", "a//b", "a/msg/"])
def test_what_is_no_type_name_is_refused(name):
    with pytest.raises(BagError, match="PACKAGE/msg/NAME"):
        split_type_name(name)


@pytest.mark.parametrize("name", ["nowhere_msgs/msg/X", "std_msgs/msg/Nonesuch", "../msg/X", "std_msgs/msg/.."])
def test_types_that_are_not_installed_are_refused_by_name(name):
    with pytest.raises(BagError, match="not installed"):
        schema_of(name)
