# SPDX-License-Identifier: Apache-2.0
"""Values of a mission that are no values: refused in one line that names file and key, before anything is written."""

from pathlib import Path

import pytest

from css_bringup.commands import fly
from css_common.mission import MissionError, load_mission

MISSION = Path(__file__).parents[1] / "config" / "okeefe_2013.yaml"


def mission(folder: Path, name: str) -> Path:
    """The mission of the first paper under another name."""
    text = MISSION.read_text()
    path = folder / "mission.yaml"
    path.write_text(text.replace("name: okeefe_2013", f"name: {name}"))
    assert path.read_text() != text
    return path


@pytest.mark.parametrize("value", ["!!bool foo", "!!timestamp foo", "!!int foo", "!!python/object:os.system x", "!x y"])
def test_a_tag_on_a_value_is_one_clear_line(value, tmp_path):
    path = mission(tmp_path, value)
    with pytest.raises(MissionError) as refusal:
        load_mission(str(path))
    told = str(refusal.value)
    assert str(path) in told and "mission.name" in told.replace("mission: name", "mission.name")
    assert "\n" not in told


@pytest.mark.parametrize("name", ["../elsewhere/precious", "/tmp/precious", "a/b", ".."])
def test_a_name_that_leads_elsewhere_is_refused_and_overwrites_nothing(name, tmp_path, capsys, monkeypatch):
    precious = tmp_path / "elsewhere" / "precious"
    precious.mkdir(parents=True)
    (precious / "kept").write_text("kept")
    flown_from = tmp_path / "here"
    flown_from.mkdir()
    monkeypatch.chdir(flown_from)
    assert fly.main([str(mission(tmp_path, name)), "--duration", "1"]) == 2
    complaint = capsys.readouterr().err
    assert "mission.name" in complaint and "expected a name for files" in complaint
    assert len(complaint.splitlines()) == 1
    assert (precious / "kept").read_text() == "kept" and list(flown_from.iterdir()) == []
