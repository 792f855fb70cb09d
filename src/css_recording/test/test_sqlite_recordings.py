# SPDX-License-Identifier: Apache-2.0
"""SQLite recordings are read whole: with the changes that a killed recorder left beside the file, or not at all."""

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter

from css_recording.bag_reader import BagReader
from css_recording.errors import BagError
from css_recording.recovery import recover

STEPS = 40


def read(path):
    with BagReader(path) as reader:
        return [(m.topic, m.stamp_ns, m.data) for m in reader.messages()], reader.notes


@pytest.fixture
def folder(flight, tmp_path):
    """A recording of which the second half of the messages stands in the write-ahead log only."""
    with RosbagsWriter(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connections = {
            topic.name: writer.add_connection(topic.name, topic.type, typestore=flight.typestore)
            for topic in flight.topics
        }
        messages = flight.messages(STEPS)
        for topic, stamp_ns, data in messages[: len(messages) // 2]:
            writer.write(connections[topic], stamp_ns, data)
    file = tmp_path / "bag" / "bag.db3"
    copies = {}
    with closing(sqlite3.connect(file)) as database:
        database.execute("PRAGMA journal_mode=WAL").fetchone()
        ids = dict(database.execute("SELECT name, id FROM topics").fetchall())
        for topic, stamp_ns, data in messages[len(messages) // 2 :]:
            database.execute(
                "INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", (ids[topic], stamp_ns, data)
            )
            database.commit()
        for path in (file, Path(f"{file}-wal")):
            copies[path] = path.read_bytes()
    for path, data in copies.items():  # closing has merged them
        path.write_bytes(data)
    metadata = tmp_path / "bag" / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace(f": {len(messages) // 2}", f": {len(messages)}"))
    return tmp_path / "bag"


def test_the_write_ahead_log_is_read_too_and_nothing_is_written(flight, folder):
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    folder.chmod(0o555)
    messages, notes = read(folder)
    folder.chmod(0o755)
    assert messages == flight.messages(STEPS)
    assert any("bag.db3-wal" in note and "were read too" in note for note in notes)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    assert read(folder / "bag.db3")[0] == messages


def test_a_torn_log_is_read_as_far_as_it_is_whole_and_that_is_said(flight, folder):
    log = folder / "bag.db3-wal"
    log.write_bytes(log.read_bytes()[: log.stat().st_size // 2])
    messages, _ = read(folder)
    assert flight.messages(STEPS)[: len(messages)] == messages
    assert STEPS * 3 // 2 < len(messages) < STEPS * 3
    damaged = bytearray(log.read_bytes())
    damaged[len(damaged) // 2] ^= 1
    log.write_bytes(damaged)
    fewer, notes = read(folder)
    assert len(fewer) < len(messages)
    assert any("are torn and left out" in note for note in notes)
    assert any("the files hold" in note for note in notes)  # metadata.yaml knows of more


def test_a_journal_is_rolled_back(flight, tmp_path):
    with RosbagsWriter(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        topic = flight.topics[0]
        connection = writer.add_connection(topic.name, topic.type, typestore=flight.typestore)
        for _, stamp_ns, data in flight.messages(STEPS)[::3]:
            writer.write(connection, stamp_ns, data)
    file = tmp_path / "bag" / "bag.db3"
    with closing(sqlite3.connect(file)) as database:
        database.execute("PRAGMA journal_mode=DELETE").fetchone()
        database.execute("PRAGMA cache_size=1").fetchone()
        database.execute("PRAGMA cache_spill=1").fetchone()
        database.execute("UPDATE messages SET data = zeroblob(1000)")  # spills into the file, the journal has the old
        halfway, journal = file.read_bytes(), Path(f"{file}-journal").read_bytes()
        database.rollback()
    file.write_bytes(halfway)
    Path(f"{file}-journal").write_bytes(journal)
    messages, notes = read(tmp_path / "bag")
    assert messages == flight.messages(STEPS)[::3]
    assert any("was taken back" in note for note in notes)


def test_damage_to_the_structure_is_refused(folder):
    (folder / "bag.db3-wal").unlink()
    file = folder / "bag.db3"
    data = bytearray(file.read_bytes())
    data[4096 * 3 : 4096 * 3 + 8] = bytes(8)
    file.write_bytes(data)
    with pytest.raises(BagError, match=r"bag\.db3: cannot be read as an SQLite recording"):
        BagReader(folder)
    with pytest.raises(BagError, match=r"bag\.db3: cannot be read as an SQLite recording"):
        recover(folder)


def test_a_folder_without_metadata_is_indexed_and_a_copy_is_an_mcap_recording(flight, folder, tmp_path):
    (folder / "metadata.yaml").unlink()
    with pytest.raises(BagError, match=f"unfinished.*recover {folder}"):
        BagReader(folder)
    report = recover(folder)
    assert not report.was_complete
    assert read(folder)[0] == flight.messages(STEPS)
    assert recover(folder).was_complete
    saved = recover(folder, tmp_path / "saved")
    assert read(saved.recording)[0] == flight.messages(STEPS)
    assert (saved.recording / "saved_0.mcap").exists()


def test_split_recordings_are_one_in_the_order_of_time(flight, folder, tmp_path):
    single = tmp_path / "single"
    single.mkdir()
    messages = flight.messages(STEPS)
    for number, part in enumerate((messages[60:], messages[:60])):
        with RosbagsWriter(tmp_path / f"part{number}", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
            connections = {
                topic.name: writer.add_connection(topic.name, topic.type, typestore=flight.typestore)
                for topic in flight.topics
            }
            for topic, stamp_ns, data in part:
                writer.write(connections[topic], stamp_ns, data)
        shutil.copyfile(tmp_path / f"part{number}" / f"part{number}.db3", single / f"single_{number}.db3")
    recover(single)
    assert sorted(read(single)[0]) == sorted(messages)
    assert [m[1] for m in read(single)[0]] == [m[1] for m in messages]
