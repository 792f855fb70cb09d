# SPDX-License-Identifier: Apache-2.0
"""Files of a study outlast the machine that writes them."""

import os

from css_monte_carlo.study_folder import StudyFolder


def test_a_file_gets_its_name_when_all_of_it_is_on_the_disk(tmp_path, monkeypatch):
    on_disk, sync, replace = [], os.fsync, type(tmp_path).replace

    def noted_sync(number):
        sync(number)
        on_disk.append(os.fstat(number).st_size)

    def noted_replace(source, target):
        assert on_disk.pop() == source.stat().st_size > 0
        return replace(source, target)

    monkeypatch.setattr(os, "fsync", noted_sync)
    monkeypatch.setattr(type(tmp_path), "replace", noted_replace)
    folder = StudyFolder(tmp_path / "study")
    folder.prepare({"cases": 3})
    folder.write_chunk("one", b"some cases")
    assert (tmp_path / "study" / "chunks" / "one.parquet").read_bytes() == b"some cases"
