# SPDX-License-Identifier: Apache-2.0
"""Not one bit of a recording changes unnoticed, and what is not checked is said."""

import random
import shutil
import zlib
from io import BytesIO

import pytest
from mcap.data_stream import ReadDataStream
from mcap.records import DataEnd, Footer
from presence import present

from css_recording.bag_metadata import Topic
from css_recording.bag_reader import BagReader
from css_recording.bag_storage import NO_CHECK_SUM
from css_recording.bag_writer import BagWriter
from css_recording.errors import BagError
from css_recording.mcap_file import McapFile
from css_recording.provenance import broken_entries, sealed
from css_recording.recovery import recover

MISSION = "cells:\n  field_of_view_deg: 120.0\n"


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """A small recording with everything that a recording can hold."""
    folder = tmp_path_factory.mktemp("sums") / "bag"
    topics = [Topic("/a", "builtin_interfaces/msg/Time"), Topic("/b", "builtin_interfaces/msg/Duration")]
    with BagWriter(folder, topics, {"mission": MISSION, "python": "3.11"}) as writer:
        for step in range(30):
            for topic in topics:
                writer.write(topic.name, step * 10**8, b"\0\1\0\0" + step.to_bytes(8, "little"))
        writer.add_metadata("event", {"what": "gyro off"})
        writer.attach("note", "text/plain", b"note", 5)
        writer.close({"lost": "0"})
    return folder


def everything(path):
    with BagReader(path) as reader:
        return [tuple(m) for m in reader.messages()], reader.metadata, reader.notes, reader.topics


def test_the_writer_fills_in_both_check_sums(bag):
    data = (bag / "bag_0.mcap").read_bytes()
    file = McapFile(bag / "bag_0.mcap")
    end, footer_at, summary_at = file.ending.data_end, file.ending.footer_at, present(file.ending.footer).summary_start
    file.close()
    data_end = DataEnd.read(ReadDataStream(BytesIO(data[end + 9 :])))
    assert data_end.data_section_crc == zlib.crc32(data[:end])
    footer = Footer.read(ReadDataStream(BytesIO(data[footer_at + 9 :])))
    assert footer.summary_crc == zlib.crc32(data[summary_at : footer_at + 9 + 16])
    assert everything(bag)[2] == []


def test_every_flipped_bit_is_noticed_by_the_reader_and_by_recover(bag, tmp_path):
    whole = (bag / "bag_0.mcap").read_bytes()
    file = tmp_path / "bag_0.mcap"
    dice = random.Random(5)
    for place in sorted(dice.sample(range(len(whole)), 400)):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << dice.randrange(8)
        file.write_bytes(damaged)
        with pytest.raises(BagError):
            everything(file)
        if dice.random() < 0.1:
            with pytest.raises(BagError, match=r"name an output|not an MCAP file"):
                recover(file)
            assert file.read_bytes() == damaged


def test_a_changed_mission_is_named_although_the_file_has_no_end(bag, tmp_path):
    whole = (bag / "bag_0.mcap").read_bytes()
    at = whole.index(b"120.0")
    torn = tmp_path / "bag_0.mcap"
    torn.write_bytes(whole[: at + 1] + b"3" + whole[at + 2 : -400])
    with pytest.raises(BagError, match="the mission in its record 'sunpoint' is not what was recorded"):
        recover(torn)
    report = recover(torn, tmp_path / "saved")
    assert "the mission in the record 'sunpoint' was not what was recorded" in report.losses
    with BagReader(tmp_path / "saved") as reader:
        assert reader.mission_text is None
        assert reader.description["python"] == "3.11"
        assert any("the mission in the record" in note for note in reader.notes)


def test_a_finished_file_with_a_changed_mission_and_no_check_sum_of_its_data_is_refused(bag, tmp_path):
    file = McapFile(bag / "bag_0.mcap")
    data = bytearray(file.path.read_bytes())
    at = data.index(b"120.0")
    data[at + 1] = ord("3")
    data[file.ending.data_end + 9 : file.ending.data_end + 13] = bytes(4)
    file.close()
    path = tmp_path / "bag_0.mcap"
    path.write_bytes(data)
    with pytest.raises(BagError, match=r"the mission in its record 'sunpoint'.*recover .* -o NEW"):
        BagReader(path)


def test_seals_name_what_was_changed_added_or_removed():
    entries = sealed({"mission": "a", "python": "b"})
    assert broken_entries(entries) == []
    assert sealed(entries) == entries
    assert broken_entries({**entries, "mission": "A"}) == ["mission"]
    assert broken_entries({**entries, "more": ""}) == ["more"]
    assert broken_entries({key: value for key, value in entries.items() if key != "python"}) == ["python"]
    assert broken_entries({**entries, "sha256": "{"}) == ["sha256"]
    assert broken_entries({"mission": "a"}) == []


@pytest.fixture
def unchecked(bag, tmp_path):
    """The same file as it was written when there was no check sum of the data."""
    file = McapFile(bag / "bag_0.mcap")
    data = bytearray(file.path.read_bytes())
    data[file.ending.data_end + 9 : file.ending.data_end + 13] = bytes(4)
    chunks = file.chunks
    file.close()
    path = tmp_path / "old_0.mcap"
    path.write_bytes(data)
    return path, data, chunks


def test_recordings_without_check_sum_are_read_and_it_is_said(bag, unchecked):
    path, _, _ = unchecked
    messages, _, notes, _ = everything(path)
    assert messages == everything(bag)[0]
    assert notes == [NO_CHECK_SUM]


def test_without_check_sum_lost_chunks_and_changed_times_of_chunks_are_found(unchecked):
    path, data, chunks = unchecked
    for change, words in (
        (lambda d: d.__setitem__(chunks[1].position, 0x86), "its chunks are not those of its index"),
        (lambda d: d.__setitem__(chunks[1].position + 12, 1), "its chunks are not those of its index"),
    ):
        damaged = bytearray(data)
        change(damaged)
        path.write_bytes(damaged)
        with pytest.raises(BagError, match=words):
            BagReader(path)


def test_a_damaged_attachment_is_found_in_a_torn_file(bag, tmp_path):
    whole = (bag / "bag_0.mcap").read_bytes()
    at = whole.index(b"text/plain") + len(b"text/plain") + 8
    torn = tmp_path / "bag_0.mcap"
    torn.write_bytes(whole[:at] + b"N" + whole[at + 1 : -300])
    with pytest.raises(BagError, match=r"record of type 9 at byte .* is damaged"):
        recover(torn)
    report = recover(torn, tmp_path / "saved")
    assert any("record of type 9" in loss for loss in report.losses)
    assert sum(report.messages.values()) == 60


def test_what_follows_a_damaged_record_is_saved(bag, tmp_path):
    folder = shutil.copytree(bag, tmp_path / "bag")
    file = McapFile(folder / "bag_0.mcap")
    chunks = file.chunks
    file.close()
    data = bytearray((folder / "bag_0.mcap").read_bytes())
    data[chunks[1].position + 3] = 0xFF  # of its length: the walk from record to record ends here
    (folder / "bag_0.mcap").write_bytes(data)
    with pytest.raises(BagError, match="are no records"):
        recover(folder)
    report = recover(folder, tmp_path / "saved")
    kept = [m[2] // 10**8 for m in everything(tmp_path / "saved")[0] if m[0] == "/a"]
    assert kept == [step for step in range(30) if not 8 <= step < 16]
    assert report.messages == {"/a": 22, "/b": 22}
    assert any("are no records" in loss for loss in report.losses)
