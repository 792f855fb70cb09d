# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C while a recording is written leaves none, where a part of the table would pass for all of it."""

from css_common.command import INTERRUPTED
from css_recording.bag_writer import BagWriter
from css_telemetry.commands.import_csv import main


def test_ctrl_c_while_it_is_written(tmp_path, capsys, monkeypatch):
    lines = ["time,px", *(f"{1_700_000_000 + k},0.{k % 9 + 1}" for k in range(100))]
    (tmp_path / "t.csv").write_text("\n".join(lines) + "\n")
    (tmp_path / "t.yaml").write_text("cells: {px: [1, 0, 0]}\nfield_of_view_deg: 180\n")
    calls, original = [], BagWriter.write

    def interrupted(writer, *arguments):
        calls.append(1)
        if len(calls) == 20:
            raise KeyboardInterrupt
        return original(writer, *arguments)

    monkeypatch.setattr(BagWriter, "write", interrupted)
    assert main([str(tmp_path / "t.csv"), str(tmp_path / "t.yaml"), "-o", str(tmp_path / "bag")]) == INTERRUPTED
    assert not (tmp_path / "bag").exists()
    assert capsys.readouterr().err.endswith("import_csv: interrupted; nothing written\n")
