# SPDX-License-Identifier: Apache-2.0
"""The verbs: help, unknown names, and that each names an executable of a package."""

import re
import sys
from pathlib import Path
from typing import Any

import pytest
from noting import noted

from bootstrap import checks, cli, host
from bootstrap.cli import main
from bootstrap.project import Project, Refusal
from bootstrap.verbs import OWN_USAGE, VERBS, help_text, unknown_verb
from bootstrap.version import version_text
from css_docs.reference.verbs import help_of

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("arguments", [[], ["--help"], ["-h"], ["help"]])
def test_help_names_every_verb(arguments, capsys):
    assert main(arguments) == 0
    shown = capsys.readouterr().out
    assert shown == help_text() + "\n"
    for name, verb in VERBS.items():
        assert any(line.split()[:1] == [name] and verb.summary in line for line in shown.splitlines())
    assert max(map(len, shown.splitlines())) <= 100


@pytest.mark.parametrize(("typed", "meant"), [("replai", "replay"), ("import_csv", "import-csv"), ("fyl", "fly")])
def test_unknown_verb_suggests_the_nearest(typed, meant, capsys):
    assert main([typed, "--help"]) == 2
    assert f"did you mean '{meant}'" in capsys.readouterr().err


def test_help_says_which_verbs_need_ros_where_there_is_none():
    assert "need a Jazzy" not in help_text()
    (told,) = [line for line in help_text("Darwin arm64").splitlines() if "is sourced before" in line]
    assert {"fly", "record", "play"} <= set(re.findall(r"[\w-]+", told))
    assert {"monte-carlo", "import-csv", "replay"}.isdisjoint(re.findall(r"[\w-]+", told))


@pytest.mark.parametrize("verb", [name for name, verb in VERBS.items() if verb.ros])
def test_a_verb_that_needs_ros_says_so_in_one_line_and_before_anything_is_set_up(verb, monkeypatch, capsys):
    monkeypatch.setenv("SUNPOINT_MACHINE", "Linux aarch64")
    for name in ("ROS_DISTRO", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(cli, "_prepare", lambda *_: pytest.fail("it began to set something up"))
    assert main([verb]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"sunpoint: {verb} needs ROS 2 Jazzy") and "source /opt/ros/jazzy" in line


def test_a_sourced_jazzy_is_used_on_any_machine(tmp_path, monkeypatch, capsys):
    rclpy = tmp_path / "lib" / f"python3.{sys.version_info[1]}" / "site-packages" / "rclpy"
    rclpy.mkdir(parents=True)
    for name, value in (("MACHINE", "Linux aarch64"), ("HOME", "")):
        monkeypatch.setenv(f"SUNPOINT_{name}", value)
    monkeypatch.setenv("ROS_DISTRO", "jazzy")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    asked = []

    def prepare(_project, ros, base, *_):
        asked.append((ros, host.system_python(base)))
        raise Refusal("far enough")

    monkeypatch.setattr(cli, "_prepare", prepare)
    monkeypatch.setattr(cli, "find_need", lambda *_: True)
    assert main(["fly"]) == 1
    assert capsys.readouterr().err == "sunpoint: far enough\n"
    assert [ros for ros, _ in asked] == ["system"]
    assert f"python3.{sys.version_info[1]}" in asked[0][1]


def test_unknown_verb_without_a_near_one_points_to_the_help():
    assert "--help" in unknown_verb("zzzzzz")


def test_verbs_without_executable_explain_themselves(capsys):
    assert {name for name, verb in VERBS.items() if not verb.package} == set(OWN_USAGE)
    for name in OWN_USAGE:
        assert main([name, "--help"]) == 0
        told = capsys.readouterr().out
        assert told.startswith(f"Usage: ./sunpoint {name}")
        lines = told.splitlines()
        examples = lines[lines.index("examples:") + 1 : lines.index("exit codes:") - 1]
        assert examples and all(line.startswith(f"  ./sunpoint {name}") for line in examples)
        assert lines[lines.index("exit codes:") + 1 :]


def test_what_a_verb_alone_needs_is_locked_and_not_asked_for_by_its_help(monkeypatch, capsys):
    extras = {name: verb.extra for name, verb in VERBS.items() if verb.extra}
    assert {"docs", "completion"} <= extras.keys()
    for extra in extras.values():
        lock = (Path(__file__).parents[2] / f"requirements-{extra}.lock").read_text(encoding="utf-8")
        assert lock.count("--hash=sha256:") >= lock.count("==") > 0
    asked: list[Any] = []
    monkeypatch.setattr(cli, "find_need", lambda *given: noted(asked, given[-1], False))
    monkeypatch.setattr(cli, "_replace_process", lambda command, env: noted(asked, env.get("PYTHONPATH", ""), 0))
    assert main(["docs", "--help"]) == 0
    assert main(["docs"]) == 0
    assert asked[0] == "" and "extra" not in asked[1]
    assert asked[2] == "docs" and asked[3].split(":")[0].endswith(".venv/extra/docs")


def test_a_verb_that_prints_a_table_prints_json_too():
    without = {name for name, verb in VERBS.items() if verb.package and "--json" not in help_of(ROOT, name)}
    assert without == {"recover", "completion", "console"}  # which print none


def test_executables_are_names_of_modules():
    for verb in VERBS.values():
        assert bool(verb.package) == bool(verb.executable)
        assert verb.executable.isidentifier() or not verb.executable


def test_version(capsys):
    assert main(["--version"]) == 0
    assert re.fullmatch(r"sunpoint \d+\.\d+\.\d+( \([0-9a-f]+(-dirty)?\))?\n", capsys.readouterr().out)


def test_version_without_a_checkout(tmp_path):
    manifest = tmp_path / "src" / "css_bringup" / "package.xml"
    manifest.parent.mkdir(parents=True)
    manifest.write_text("<package><version>1.2.3</version></package>")
    assert version_text(Project(tmp_path)) == "sunpoint 1.2.3"
    (tmp_path / ".git").mkdir()
    assert version_text(Project(tmp_path)) == "sunpoint 1.2.3"


@pytest.fixture
def started(monkeypatch):
    """What the verbs become, and which linters ran."""
    happened: list[Any] = []
    monkeypatch.setattr(cli, "find_need", lambda *_: False)
    monkeypatch.setattr(cli, "_replace_process", lambda command, env: noted(happened, command[2:], 0))
    monkeypatch.setattr(checks, "failing_linters", lambda project, env, linters: noted(happened, linters, []))
    monkeypatch.chdir(Path.cwd())
    return happened


def test_linters_run_with_all_tests_and_on_request(started):
    assert main(["test"]) == 0
    assert main(["lint"]) == 0
    assert started == [checks.STYLE, ["pytest", *cli.ALL_TESTS], (*checks.STYLE, checks.TYPES)]


def test_named_tests_run_alone(started):
    assert main(["test", "tests/test_verbs.py"]) == 0
    assert started == [["pytest", "tests/test_verbs.py"]]
