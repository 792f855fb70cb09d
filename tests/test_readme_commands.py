# SPDX-License-Identifier: Apache-2.0
"""Every command printed in the documents is one that works."""

import importlib
import shlex
from pathlib import Path

import pytest

from bootstrap.verbs import VERBS
from css_analysis.commands import slit_analyse
from css_bringup.commands import fly, replay
from css_bringup.replay_bag import default_replay
from css_common.command import USAGE
from css_telemetry.commands import import_csv

ROOT = Path(__file__).parents[1]
DOCUMENTS = (*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("src/*/README.md"), *ROOT.glob("b*/README.md"))


def commands(document):
    """Commands of ./sunpoint with a line of their own in a document: the verb and its arguments, in their order."""
    lines = document.read_text(encoding="utf-8").splitlines()
    words = [shlex.split(line.split(" > ")[0], comments=True) for line in lines if line.startswith("./sunpoint ")]
    return [(verb, arguments) for _, verb, *arguments in words]


ALL = [
    pytest.param(verb, arguments, id=f"{document.parent.name}: {' '.join((verb, *arguments))}")
    for document in DOCUMENTS
    for verb, arguments in commands(document)
]


@pytest.mark.parametrize(("verb", "arguments"), ALL)
def test_each_is_understood_by_its_own_parser(verb, arguments):
    if verb.startswith("--"):
        return
    entry = VERBS[verb]
    if not entry.package:
        return
    folders = ("nodes", "commands")
    files = [ROOT / "src" / entry.package / entry.package / name / f"{entry.executable}.py" for name in folders]
    (folder,) = [file.parent.name for file in files if file.is_file()]
    module = importlib.import_module(f"{entry.package}.{folder}.{entry.executable}")
    module._parser().parse_args(arguments)  # ends the process where it is wrong


def test_there_are_commands_to_try():
    assert len(ALL) > 28


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A fresh folder with what the checkout has, in which the commands run in the order in which they are printed."""
    folder = tmp_path_factory.mktemp("newcomer")
    (folder / "docs").symlink_to(ROOT / "docs")
    (folder / "bags").mkdir()
    return folder


def of_verb(verb, word=""):
    """The one command of the README with this verb and a word."""
    (arguments,) = [given for name, given in commands(ROOT / "README.md") if name == verb and word in " ".join(given)]
    return arguments


def test_a_flight_and_its_replays_do_not_collide(place, monkeypatch, capfd):
    monkeypatch.chdir(place)
    assert fly.main([*of_verb("fly", "--out"), "--duration", "8"]) != USAGE
    arguments = of_verb("replay", "bags/first")
    for name in ("first_replay", "first_replay_2"):
        assert replay.main(arguments) == 0
        assert (place / "bags" / name / "metadata.yaml").is_file()
    assert replay.main([*arguments, "--out", "bags/first_replay"]) == USAGE
    assert "--overwrite" in capfd.readouterr().err
    assert default_replay(place / "bags" / "first").name == "first_replay_3"
    assert default_replay(place / "bags" / "first", overwrite=True).name == "first_replay"


def test_telemetry_is_imported_and_replayed(place, monkeypatch, capfd):
    monkeypatch.chdir(place)
    assert import_csv.main(of_verb("import-csv", "--describe")) == 0
    assert import_csv.main(of_verb("import-csv", "bags/mine")) == 0
    assert "broken" not in capfd.readouterr().out
    assert replay.main(of_verb("replay", "bags/mine")) == 0


def test_pulses_are_analysed(place, monkeypatch, capfd):
    monkeypatch.chdir(place)
    assert slit_analyse.main(of_verb("slit-analyse")) == 0
    assert "0.2618 s" in capfd.readouterr().out
