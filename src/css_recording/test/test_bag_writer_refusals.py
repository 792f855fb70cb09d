# SPDX-License-Identifier: Apache-2.0
"""What a recorder cannot do it says, and what it has written stays."""

import shutil
import subprocess
import sys

import pytest

from css_common.testing import DEADLINE
from css_recording.bag_metadata import Topic
from css_recording.bag_reader import BagReader
from css_recording.bag_writer import BagWriter
from css_recording.errors import BagError
from css_recording.recovery import recover

# A process that may write no more than this many bytes into one file: a full disk.
FULL_DISK = """
import resource, sys
from css_recording.bag_writer import BagWriter
from css_recording.bag_metadata import Topic
from css_recording.errors import BagError

resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
try:
    writer = BagWriter(sys.argv[1], [Topic("/css/voltages", "css_msgs/msg/CssVoltages")], {"mission": "m: 1"})
    for step in range(20_000):
        writer.write("/css/voltages", step * 100_000_000, b"\\0\\1\\0\\0" + step.to_bytes(8, "little") * 20)
except BagError as error:
    print(error)
    for attempt in (lambda: writer.write("/css/voltages", 0, b""), writer.flush):
        try:
            attempt()
            sys.exit("went on after the disk was full")
        except BagError as again:
            assert str(again) == str(error)
    writer.close()
    assert writer.closed
"""


@pytest.mark.parametrize("limit", [20_000, 100_000])
def test_a_full_disk_ends_the_recording_and_keeps_what_was_written(tmp_path, limit):
    folder = tmp_path / "bag"
    run = subprocess.run(
        [sys.executable, "-c", FULL_DISK, str(folder), str(limit)],
        capture_output=True,
        text=True,
        timeout=DEADLINE,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert "cannot write the recording" in run.stdout
    assert f"recover {folder}" in run.stdout
    kept = recover(folder).messages["/css/voltages"]
    assert kept > 0 and kept % 8 == 0  # chunks of 0.8 s
    with BagReader(folder) as reader:
        assert [m.stamp_ns for m in reader.messages()] == [step * 100_000_000 for step in range(kept)]


FULL_DISK_AT_RECOVERY = """
import resource, sys
from css_recording.recovery import recover
from css_recording.errors import BagError

resource.setrlimit(resource.RLIMIT_FSIZE, (8_000, resource.RLIM_INFINITY))
try:
    recover(*sys.argv[1:])
except BagError as error:
    print(error)
    sys.exit(3)
"""


@pytest.mark.parametrize("elsewhere", [False, True])
def test_a_disk_that_is_full_at_recovery_leaves_everything_as_it_was(flight, tmp_path, elsewhere):
    folder = flight.record(tmp_path / "bag", 60)
    file = folder / "bag_0.mcap"
    file.write_bytes(file.read_bytes()[:-500])
    (folder / "metadata.yaml").unlink()
    before = file.read_bytes()
    arguments = [str(folder), str(tmp_path / "saved")][: 1 + elsewhere]
    command = [sys.executable, "-c", FULL_DISK_AT_RECOVERY, *arguments]
    run = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE, check=False)
    assert run.returncode == 3, run.stderr
    assert run.stdout.startswith(f"{folder}: cannot be recovered: File too large; it is as it was.")
    assert "output on another disk" in run.stdout
    assert ".recovering" not in run.stdout
    assert [path.name for path in folder.iterdir()] == ["bag_0.mcap"]
    assert file.read_bytes() == before
    assert not (tmp_path / "saved").exists()
    assert sum(recover(folder).messages.values()) == 180


def record_until_it_ends(flight, writer, disturb):
    """Write 6 s of a flight, disturbed after 3 s; gives the error with which the recording ended."""
    for step in range(60):
        if step == 30:
            disturb()
        for message in flight.messages(1, first=step):
            try:
                writer.write(*message)
            except BagError as error:
                return str(error), step
    raise AssertionError("it was not noticed")


def test_a_folder_that_is_deleted_in_flight_is_noticed_within_a_second_and_saved_beside(flight, tmp_path):
    folder = tmp_path / "bag"
    writer = BagWriter(folder, flight.topics, {"mission": "m: 1"})
    error, step = record_until_it_ends(flight, writer, lambda: shutil.rmtree(folder))
    assert step <= 40
    saved = tmp_path / "bag_rescued"
    assert error.startswith(f"{folder}: was deleted while it was being recorded; the ")
    assert error.endswith(f"messages until then are in {saved}")
    with pytest.raises(BagError, match="was deleted"):
        writer.flush()
    writer.close()
    with BagReader(saved) as reader:
        messages = [(m.topic, m.stamp_ns, m.data) for m in reader.messages()]
        assert reader.mission_text == "m: 1"
    assert messages == flight.messages(60)[: len(messages)]
    assert len(messages) >= 90
    assert not folder.exists()


@pytest.mark.parametrize("what", ["folder", "file"])
def test_a_folder_that_is_moved_in_flight_is_noticed_and_finished_in_its_new_place(flight, tmp_path, what):
    folder, new = tmp_path / "bag", tmp_path / "new"
    writer = BagWriter(folder, flight.topics)
    if what == "folder":
        error, _ = record_until_it_ends(flight, writer, lambda: folder.rename(new))
    else:
        new.mkdir()
        error, _ = record_until_it_ends(flight, writer, lambda: writer.path.rename(new / "y.mcap"))
    assert error.startswith(f"{folder}: was moved while it was being recorded; the ")
    assert error.endswith(f"are in {new}")
    with BagReader(new) as reader:
        messages = [(m.topic, m.stamp_ns, m.data) for m in reader.messages()]
    assert messages == flight.messages(60)[: len(messages)]
    assert len(messages) >= 90
    assert not (folder / "metadata.yaml").exists()


def test_a_folder_that_is_deleted_at_the_end_is_noticed_when_it_is_closed(flight, tmp_path):
    writer = BagWriter(tmp_path / "bag", flight.topics)
    for message in flight.messages(2):
        writer.write(*message)
    shutil.rmtree(tmp_path / "bag")
    with pytest.raises(BagError, match=f"the 6 messages until then are in {tmp_path / 'bag_rescued'}"):
        writer.close()
    with BagReader(tmp_path / "bag_rescued") as reader:
        assert reader.message_count == 6


def test_a_disk_that_is_full_from_the_start_is_refused(tmp_path):
    code = FULL_DISK.replace("    for attempt in", "    sys.exit(3)\n    for attempt in")
    command = [sys.executable, "-c", code, str(tmp_path / "bag"), "100"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE, check=False)
    assert run.returncode == 3, run.stderr
    assert "cannot write the recording" in run.stdout


def test_a_folder_that_is_not_empty_is_refused(flight, tmp_path):
    folder = flight.record(tmp_path / "bag", 5)
    before = (folder / "bag_0.mcap").read_bytes()
    with pytest.raises(BagError, match="not empty"):
        BagWriter(folder, flight.topics)
    assert (folder / "bag_0.mcap").read_bytes() == before


def test_overwriting_replaces_a_recording_and_nothing_else(flight, tmp_path):
    folder = flight.record(tmp_path / "bag", 5)
    (folder / "bag_1.mcap").touch()
    flight.record(folder, 12, overwrite=True)
    with BagReader(folder) as reader:
        assert reader.message_count == 36
    assert not (folder / "bag_1.mcap").exists()
    (folder / "thesis.txt").touch()
    with pytest.raises(BagError, match=r"thesis\.txt"):
        flight.record(folder, 3, overwrite=True)
    with BagReader(folder) as reader:
        assert reader.message_count == 36
    (folder / "thesis.txt").unlink()
    (folder / "folder").mkdir()
    with pytest.raises(BagError, match="folder"):
        flight.record(folder, 3, overwrite=True)


def test_folders_that_cannot_be_made_are_refused(flight, tmp_path):
    (tmp_path / "file").touch()
    for folder in (tmp_path / "file", tmp_path / "file" / "bag", "/proc/nowhere/bag", tmp_path / ("x" * 300)):
        with pytest.raises(BagError, match="cannot create the recording"):
            BagWriter(folder, flight.topics)


def test_unknown_types_are_refused_before_anything_is_written(tmp_path):
    with pytest.raises(BagError, match="not installed"):
        BagWriter(tmp_path / "bag", [Topic("/a", "nowhere_msgs/msg/X")])
    assert not (tmp_path / "bag").exists()


def test_misuse_is_named(flight, tmp_path):
    with BagWriter(tmp_path / "bag", flight.topics) as writer:
        with pytest.raises(BagError, match=r"/nonesuch.*not added"):
            writer.write("/nonesuch", 0, b"")
        with pytest.raises(BagError, match="recorded as css_msgs/msg/CssVoltages"):
            writer.add_topic(Topic("/css/voltages", "std_msgs/msg/Header"))
    writer.close()
    for action in (
        lambda: writer.write("/css/voltages", 0, b""),
        lambda: writer.add_topic(Topic("/b", "std_msgs/msg/Header")),
        lambda: writer.add_metadata("event", {}),
        writer.flush,
    ):
        with pytest.raises(BagError, match="closed"):
            action()


def test_an_error_in_flight_still_finishes_the_recording(flight, tmp_path):
    def fail_in_flight():
        with BagWriter(tmp_path / "bag", flight.topics) as writer:
            for message in flight.messages(15):
                writer.write(*message)
            _ = 1 / 0

    with pytest.raises(ZeroDivisionError):
        fail_in_flight()
    with BagReader(tmp_path / "bag") as reader:
        assert reader.message_count == 45


def test_counts_are_of_what_was_received(flight, tmp_path):
    with BagWriter(tmp_path / "bag", flight.topics) as writer:
        for message in flight.messages(25):
            writer.write(*message)
        assert writer.counts == {topic.name: 25 for topic in flight.topics}
    assert writer.counts == {topic.name: 25 for topic in flight.topics}


def test_the_order_of_arrival_does_not_change_a_byte(flight, tmp_path):
    messages = flight.messages(40)
    swapped = [message for first in range(0, 120, 6) for message in reversed(messages[first : first + 6])]
    files = []
    for name, arrival in (("a", messages), ("b", swapped)):
        folder = tmp_path / name / "bag"
        with BagWriter(folder, flight.topics, {"mission": "m: 1"}) as writer:
            for message in arrival:
                writer.write(*message)
        files.append([(folder / file).read_bytes() for file in ("bag_0.mcap", "metadata.yaml")])
    assert files[0] == files[1]
