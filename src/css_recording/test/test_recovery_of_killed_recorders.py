# SPDX-License-Identifier: Apache-2.0
"""Whatever the instant at which a recorder is killed, `recover` keeps every chunk that reached the file."""

import os
import random
import shutil
import subprocess
import sys
import time
from contextlib import suppress
from typing import Any

import pytest
from presence import present
from rosbags.highlevel import AnyReader

from css_recording.bag_metadata import Topic
from css_recording.bag_reader import BagReader
from css_recording.bag_writer import BagWriter
from css_recording.commands.recover import main
from css_recording.errors import BagError
from css_recording.mcap_file import McapFile
from css_recording.recovery import recover

# Writes messages as fast as it can and says each time what it has handed over.
RECORDER = """
import sys
from css_recording.bag_writer import BagWriter
from css_recording.bag_metadata import Topic

data = bytes.fromhex(sys.argv[2])
topic = Topic("/css/voltages", "css_msgs/msg/CssVoltages")
with BagWriter(sys.argv[1], [topic], {"mission": "m: 1"}) as writer:
    for step in range(10**9):
        writer.write("/css/voltages", step * 20_000_000, data + step.to_bytes(8, "little"))
        print(step, flush=True)
"""
STEPS_PER_SECOND = 50


def contents(path):
    with BagReader(path) as reader:
        return [(m.topic, m.stamp_ns, m.data) for m in reader.messages()]


@pytest.mark.parametrize("seed", range(5))
def test_sigkill_costs_at_most_the_open_second(flight, tmp_path, seed, doctor):
    folder = tmp_path / "flight"
    data = flight.messages(1)[0][2]
    process = subprocess.Popen(
        [sys.executable, "-c", RECORDER, str(folder), data.hex()], stdout=subprocess.PIPE, text=True
    )
    delay = random.Random(seed).uniform(0.0, 0.1)
    lines = [present(process.stdout).readline()]
    deadline = time.monotonic() + delay
    while time.monotonic() < deadline:
        lines.append(present(process.stdout).readline())
    process.kill()
    lines += present(process.stdout).readlines()
    process.wait()
    handed_over = int([line for line in lines if line.endswith("\n")][-1]) + 1

    with pytest.raises(BagError, match="recover"):
        BagReader(folder)
    report = recover(folder)
    assert not report.was_complete
    kept = report.messages["/css/voltages"]
    assert kept >= handed_over - STEPS_PER_SECOND
    expected = [("/css/voltages", step * 20_000_000, data + step.to_bytes(8, "little")) for step in range(kept)]
    assert contents(folder) == expected
    with BagReader(folder) as reader:
        assert reader.mission_text == "m: 1"
    with AnyReader([folder]) as reader:
        assert sum(1 for _ in reader.messages()) == kept
    doctor(folder / "flight_0.mcap")
    assert recover(folder).was_complete


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A small recording with everything a recording can hold, its bytes and its messages."""
    folder = tmp_path_factory.mktemp("small") / "small"
    topics = [Topic("/a", "builtin_interfaces/msg/Time"), Topic("/b", "builtin_interfaces/msg/Duration")]
    messages = [
        (topic.name, step * 100_000_000, b"\0\1\0\0" + step.to_bytes(8, "little"))
        for step in range(26)
        for topic in topics
    ]
    with BagWriter(folder, topics, {"mission": "m: 1"}) as writer:
        for message in messages[:30]:
            writer.write(*message)
        writer.add_metadata("event", {"what": "gyro off"})
        writer.attach("note", "text/plain", b"note", 5)
        for message in messages[30:]:
            writer.write(*message)
    return folder, writer.path.read_bytes(), messages


def test_no_truncation_crashes_recovery_or_makes_up_a_message(small, tmp_path):
    # Recovery sees of a file only its intact records. They are found for every length; the recovery itself is
    # run at both ends of each range of lengths that have the same ones.
    _, whole, messages = small
    torn = tmp_path / "torn.mcap"
    ranges: list[Any] = []
    for length in range(8):
        torn.write_bytes(whole[:length])
        with pytest.raises(BagError, match=r"torn\.mcap"):
            recover(torn)
    torn.write_bytes(whole)
    for length in range(len(whole), 7, -1):
        os.truncate(torn, length)
        file = McapFile(torn)
        seen = (file.records, file.schemas, file.channels, file.statistics, file.complete)
        file.close()
        if not ranges or ranges[-1][0] != seen:
            ranges.append((seen, [length]))
        ranges[-1][1].append(length)
    most = 0
    for _, lengths in reversed(ranges):
        for length in (lengths[-1], lengths[0]):
            torn.write_bytes(whole[:length])
            report = recover(torn)
            kept = sum(report.messages.values())
            assert report.was_complete == (length == len(whole))
            assert report.damaged_chunks == report.refused_messages == 0
            assert contents(torn) == messages[:kept]
            assert kept >= most
        most = kept
    assert most == len(messages)


def test_recovery_of_an_unclosed_folder_equals_closing_it(flight, tmp_path):
    closed, killed = tmp_path / "closed" / "bag", tmp_path / "killed" / "bag"
    for folder in (closed, killed):
        writer = BagWriter(folder, flight.topics, {"mission": "m: 1"})
        for step in range(45):
            for message in flight.messages(1, first=step):
                writer.write(*message)
            if step == 17:
                writer.add_metadata("event", {"step": "17"})
        writer.flush()
        if folder == closed:
            writer.close({"recovery": "bag_0.mcap had no end: up to a second may be missing"})
        else:
            shutil.copytree(folder, tmp_path / "copy")  # while the recorder lives
    recover(tmp_path / "copy", killed.parent / "new" / "bag")
    for name in ("bag_0.mcap", "metadata.yaml"):
        assert (killed.parent / "new" / "bag" / name).read_bytes() == (closed / name).read_bytes()


def test_complete_recordings_are_left_alone(small, tmp_path):
    folder = shutil.copytree(small[0], tmp_path / "small")
    before = {path.name: (path.stat().st_mtime_ns, path.read_bytes()) for path in folder.iterdir()}
    report = recover(folder)
    assert report.was_complete
    assert sum(report.messages.values()) == len(small[2])
    assert before == {path.name: (path.stat().st_mtime_ns, path.read_bytes()) for path in folder.iterdir()}


def test_missing_metadata_are_written_again(small, tmp_path):
    folder = shutil.copytree(small[0], tmp_path / "small")
    (folder / "metadata.yaml").unlink()
    assert not recover(folder).was_complete
    assert (folder / "metadata.yaml").read_bytes() == (small[0] / "metadata.yaml").read_bytes()
    assert contents(folder) == small[2]
    assert sorted(os.listdir(folder)) == ["metadata.yaml", "small_0.mcap"]


def test_output_leaves_the_torn_recording_untouched(small, tmp_path):
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(small[1][:-1000])
    report = recover(torn, tmp_path / "mended")
    assert torn.read_bytes() == small[1][:-1000]
    assert report.recording == tmp_path / "mended"
    assert contents(tmp_path / "mended") == small[2][: sum(report.messages.values())]


def test_an_interrupted_recovery_is_repeated(small, tmp_path, monkeypatch):
    folder = shutil.copytree(small[0], tmp_path / "small")
    (folder / "small_0.mcap").write_bytes(small[1][:-1000])
    (folder / "metadata.yaml").unlink()

    def interrupt(*arguments):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("css_recording.recovery.write_atomically", interrupt)
        with pytest.raises(KeyboardInterrupt):
            recover(folder)
    assert not (folder / "metadata.yaml").exists()
    (folder / ".small_0.mcap.recovering").mkdir()
    (folder / ".small_0.mcap.recovering" / "junk").touch()
    recover(folder)
    assert contents(folder) == small[2]
    assert sorted(os.listdir(folder)) == ["metadata.yaml", "small_0.mcap"]


def test_a_recording_that_is_being_written_is_not_touched(flight, tmp_path):
    with BagWriter(tmp_path / "bag", flight.topics) as writer:
        for message in flight.messages(30):
            writer.write(*message)
        with pytest.raises(BagError, match="being written"):
            recover(tmp_path / "bag")
    assert contents(tmp_path / "bag") == flight.messages(30)


def test_damage_inside_is_never_thrown_away_unasked(small, tmp_path):
    file = tmp_path / "bag.mcap"
    for place in (300, len(small[1]) // 2, len(small[1]) * 3 // 4):
        damaged = bytearray(small[1])
        damaged[place : place + 8] = bytes(byte ^ 0xFF for byte in damaged[place : place + 8])
        file.write_bytes(damaged)
        before = file.read_bytes()
        try:
            recover(file)
        except BagError as error:
            assert "name an output" in str(error)
            assert file.read_bytes() == before
            shutil.rmtree(tmp_path / "out", ignore_errors=True)
            recover(file, tmp_path / "out")
            assert set(contents(tmp_path / "out")) <= set(small[2])
        else:
            assert contents(file) == small[2]


def test_random_damage_crashes_nothing(small, tmp_path):
    generator = random.Random(11)
    file = tmp_path / "bag.mcap"
    for number in range(100):
        damaged = bytearray(small[1])
        for _ in range(generator.randint(1, 4)):
            damaged[generator.randrange(len(damaged))] = generator.randrange(256)
        file.write_bytes(damaged)
        for action in (contents, lambda path, number=number: recover(path, tmp_path / str(number))):
            with suppress(BagError):
                action(file)


def test_what_cannot_be_recovered_is_refused(tmp_path):
    with pytest.raises(BagError, match="no such recording"):
        recover(tmp_path / "nowhere")
    with pytest.raises(BagError, match=r"no \.mcap or \.db3 file"):
        recover(tmp_path)
    for name in ("a.mcap", "b.mcap"):
        (tmp_path / name).write_bytes(b"hello")
    with pytest.raises(BagError, match=r"a\.mcap: is not an MCAP file"):
        recover(tmp_path)
    with pytest.raises(BagError, match="not an MCAP file"):
        recover(tmp_path / "a.mcap")


def test_command_reports_and_exits_as_it_says(small, tmp_path, capsys):
    folder = shutil.copytree(small[0], tmp_path / "small")
    (folder / "metadata.yaml").unlink()
    (folder / "small_0.mcap").write_bytes(small[1][:-600])
    assert main([str(folder)]) == 0
    printed = capsys.readouterr().out
    assert "recovered, 52 messages" in printed
    assert "lost or in doubt: the last" in printed
    assert main([str(folder)]) == 0
    assert "was complete, 52 messages" in capsys.readouterr().out
    assert main([str(tmp_path / "nowhere")]) == 2
    assert "no such recording" in capsys.readouterr().err
    with pytest.raises(SystemExit) as exit_info:
        main([])
    assert exit_info.value.code == 2
