# SPDX-License-Identifier: Apache-2.0
"""Installing and building: one at a time, resumed after an interruption, failures explained."""

import errno
import os
import signal
import subprocess
import sys
import textwrap

import pytest
from presence import present

from bootstrap import build as building
from bootstrap import workspace
from bootstrap.plan import Need
from bootstrap.progress import CommandFailed, Step, run
from bootstrap.project import Project, Refusal, State
from bootstrap.work import Work
from css_common import places


@pytest.fixture
def project(tmp_path):
    (tmp_path / ".venv").mkdir()
    project = Project(tmp_path)
    project.logs.mkdir(parents=True)
    return project


@pytest.fixture
def work(project):
    return Work(project, "wheels", {}, State())


def test_a_command_that_fails_shows_the_end_of_its_output(tmp_path):
    log = tmp_path / "log"
    log.write_text("earlier\n")
    with pytest.raises(CommandFailed) as failure, Step("counting") as step:
        run(step, ["sh", "-c", "seq 100; exit 3"], os.environ, tmp_path, log)
    assert failure.value.output.splitlines()[-1] == "100"
    assert "earlier" not in failure.value.output
    assert len(failure.value.output.splitlines()) == 25
    assert log.read_text().startswith("earlier\n$ sh -c")


@pytest.mark.parametrize(
    ("output", "expected"),
    [
        ("error sending request for url (https://pypi.org/simple/numpy/)", "could not be reached"),
        ("ERROR: No matching distribution found for uv==1", "could not be reached"),
        ("OSError: [Errno 28] No space left on device", "no space left"),
        ("sun.cpp:1: error: expected ';'", "sun.cpp:1: error: expected ';'"),
    ],
)
def test_failures_are_explained(work, output, expected):
    assert expected in str(work.explained(CommandFailed(output, work.project.logs / "x.log")))


@pytest.mark.parametrize(("number", "expected"), [(errno.ENOSPC, "no space left"), (errno.EACCES, "cannot write")])
def test_errors_of_the_file_system_are_explained(project, monkeypatch, number, expected):
    def fail(*_):
        raise OSError(number, "refused", "file")

    monkeypatch.setattr(workspace, "find_need", fail)
    with pytest.raises(Refusal, match=expected):
        workspace.prepare(project, "wheels", {}, with_tests=False)


START = """
    import pathlib, sys, time
    sys.path[:0] = {paths!r}
    from bootstrap import workspace
    from bootstrap.plan import Need
    from bootstrap.project import Project
    from bootstrap.progress import Step, Terminated, run

    done = pathlib.Path({root!r}, "done")

    def install(work):
        with Step("pretending") as step:
            run(step, ["sh", "-c", {command!r}], {{"PATH": "/usr/bin:/bin"}}, {root!r},
                work.log("x.log"))
        done.write_text(done.read_text() + "x" if done.exists() else "x")

    workspace.install = install
    workspace.find_need = lambda *_, **__: Need(not done.exists(), False, {{}}, ())
    try:
        workspace.prepare(Project(pathlib.Path({root!r})), "wheels", {{}}, False)
    except Terminated as stop:
        sys.exit(stop.exit_code)
"""


def start(project, command):
    paths = [os.path.dirname(os.path.dirname(present(module.__file__))) for module in (workspace, places)]
    code = textwrap.dedent(START).format(paths=paths, root=str(project.root), command=command)
    return subprocess.Popen([sys.executable, "-I", "-S", "-c", code], stderr=subprocess.PIPE, text=True)


LIMIT_S = 200.0
"""Wall time that only a failure reaches: a loaded machine takes its time."""


def until_running(process):
    """Waits until the start is inside its command."""
    for line in process.stderr:
        if "pretending" in line:
            return
    raise AssertionError("it ended before")


def test_second_start_waits_and_finds_everything_done(project):
    first = start(project, "sleep 0.6")
    until_running(first)
    second = start(project, "sleep 0.6")
    assert "waiting" in second.stderr.readline()
    assert (first.wait(LIMIT_S), second.wait(LIMIT_S)) == (0, 0)
    assert (project.root / "done").read_text() == "x"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interruption_stops_everything_that_was_started(project, number):
    begun = project.root / "begun"
    os.mkfifo(begun)
    # all that the command starts holds the pipe open, for longer than anybody waits here, unless it is stopped
    process = start(project, f"exec 3> {begun}; sleep 3600 & echo >&3; sleep 3600")
    with begun.open(encoding="utf-8") as pipe:
        pipe.readline()
        process.send_signal(number)
        process.communicate(timeout=LIMIT_S)
        assert process.returncode == (143 if number == signal.SIGTERM else -signal.SIGINT)
        assert pipe.read() == "", "the last that held it has ended"
    assert not (project.root / "done").exists()
    # The lock is free again, so nothing of it is left behind.
    assert start(project, "true").wait(LIMIT_S) == 0


def fake_colcon(project, results):
    """Stands for colcon: leaves exit codes as it does, and fails like it. And what it is called with."""

    commands = []

    def run_colcon(_work, _step, command, _log):
        commands.append([str(part) for part in command])
        for name, code in results.items():
            folder = project.build / name
            folder.mkdir(parents=True, exist_ok=True)
            (folder / "colcon_build.rc").write_text(f"{code}\n")
        if any(results.values()):
            raise Refusal("colcon failed")

    return run_colcon, commands


def need(**packages):
    return Need(False, False, packages, ())


def test_packages_that_were_built_are_remembered_when_another_fails(work, monkeypatch):
    project = work.project
    monkeypatch.setattr(Work, "run", fake_colcon(project, {"good": 0, "bad": 1, "edited": 1})[0])
    work.state.packages = {"edited": "0", "other": "4"}
    with pytest.raises(Refusal):
        building.build(work, need(good="1", bad="2", edited="3"))
    assert State.load(project.state_file).packages == {"other": "4", "good": "1", "edited": building.FAILED}


def test_interrupted_package_begins_from_nothing(work, monkeypatch):
    project = work.project
    for folder in (project.build, project.install):
        (folder / "half").mkdir(parents=True)
        (folder / "half" / "left over").touch()

    def interrupted(*_):
        assert not list(project.root.rglob("left over"))
        raise KeyboardInterrupt

    monkeypatch.setattr(Work, "run", interrupted)
    with pytest.raises(KeyboardInterrupt):
        building.build(work, need(half="1"))
    assert State.load(project.state_file).packages == {}


def test_executables_of_removed_nodes_do_not_stay(work, monkeypatch):
    project = work.project
    monkeypatch.setattr(Work, "run", fake_colcon(project, {"sim": 0})[0])
    stale = project.executable("sim", "old_node")
    stale.parent.mkdir(parents=True)
    stale.touch()
    module = project.build / "sim" / "kept.o"
    module.parent.mkdir(parents=True)
    module.touch()
    work.state.packages = {"sim": "0"}
    building.build(work, need(sim="1"))
    assert not stale.exists()
    assert module.exists()
    assert work.state.packages == {"sim": "1"}


@pytest.mark.parametrize(
    ("built", "changed", "folder", "option"),
    [
        ({}, "sim", "nodes", None),
        ({"other": "1", "sim": "0"}, "sim", "nodes", "--packages-select"),
        ({"other": "1", "msgs": "0"}, "msgs", "msg", "--packages-above"),
    ],
    ids=["first build", "one package", "messages"],
)
def test_what_colcon_builds(work, monkeypatch, built, changed, folder, option):
    project = work.project
    (project.source / changed / folder).mkdir(parents=True)
    colcon, commands = fake_colcon(project, {changed: 0})
    monkeypatch.setattr(Work, "run", colcon)
    work.state.packages = dict(built)
    building.build(work, need(**{changed: "1"}))
    [command] = commands
    assert [part for part in command if part.startswith("--packages")] == ([option] if option else [])
    assert "--symlink-install" in command
    assert "-DCMAKE_BUILD_TYPE=Release" in command


def test_removed_package_disappears(work):
    project = work.project
    (project.install / "gone").mkdir(parents=True)
    work.state.packages = {"gone": "1"}
    building.build(work, Need(False, False, {}, ("gone",)))
    assert not (project.install / "gone").exists()
    assert State.load(project.state_file).packages == {}
