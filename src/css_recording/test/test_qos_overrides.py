# SPDX-License-Identifier: Apache-2.0
"""Quality of service in a file of rosbag2's form."""

import pytest
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, LivelinessPolicy, ReliabilityPolicy

from css_recording.errors import BagError
from css_recording.qos_overrides import read_qos_overrides

# as in the documentation of rosbag2
FULL = """\
/talker:
  depth: 1
  durability: volatile
  history: keep_last
  reliability: best_effort
  deadline:
    sec: 2147483647
    nsec: 4294967295
  lifespan: {sec: 1, nsec: 500000000}
  liveliness: system_default
  liveliness_lease_duration:
    sec: 2147483647
    nsec: 4294967295
  avoid_ros_namespace_conventions: false
cells:
  durability: transient_local
"""


def read(tmp_path, text):
    (tmp_path / "qos.yaml").write_text(text, encoding="utf-8")
    return read_qos_overrides(tmp_path / "qos.yaml")


def test_every_key_of_rosbag2(tmp_path):
    profiles = read(tmp_path, FULL)
    assert list(profiles) == ["/talker", "/cells"]
    talker = profiles["/talker"]
    assert (talker.depth, talker.history) == (1, HistoryPolicy.KEEP_LAST)
    assert (talker.reliability, talker.durability) == (ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE)
    assert talker.liveliness == LivelinessPolicy.SYSTEM_DEFAULT
    assert talker.lifespan == Duration(seconds=1, nanoseconds=500_000_000)
    assert not talker.avoid_ros_namespace_conventions
    cells = profiles["/cells"]
    assert (cells.depth, cells.reliability) == (10, ReliabilityPolicy.RELIABLE)
    assert cells.durability == DurabilityPolicy.TRANSIENT_LOCAL


def test_no_file_no_overrides():
    assert read_qos_overrides(None) == {}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("/a: {reliability: perfect}", "/a: reliability: 'perfect' given, expected one of system_default, reliable"),
        ("/a: {relability: reliable}", "/a: relability: no such key, expected one of history, reliability"),
        ("/a: {depth: -1}", "/a: depth: -1 given, expected a whole number from 0 on"),
        ("/a: {depth: true}", "/a: depth: True given, expected a whole number"),
        ("/a: {deadline: 3}", "/a: deadline: 3 given, expected sec and nsec"),
        ("/a: {deadline: {sec: -3}}", "expected sec and nsec"),
        ("/a: reliable", "/a: 'reliable' given, expected keys"),
        ("[1, 2]", "expected topics"),
        ("", "expected topics"),
        ("/a: [", "is no YAML"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(tmp_path, text, words):
    with pytest.raises(BagError) as caught:
        read(tmp_path, text)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(f"{tmp_path}/qos.yaml: ")


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(BagError, match=r"nowhere\.yaml: cannot be read"):
        read_qos_overrides(tmp_path / "nowhere.yaml")
