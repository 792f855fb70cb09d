# SPDX-License-Identifier: Apache-2.0
"""The small `ros2` command, against a prefix with an ament index as colcon makes it."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from presence import present

pytest.importorskip("ament_index_python")
ROS2 = Path(__file__).resolve().parents[2] / "tools" / "ros2.py"


@pytest.fixture
def prefix(tmp_path):
    """A prefix with the packages `alpha` (three files, one not executable) and `beta` (none)."""
    index = tmp_path / "share" / "ament_index" / "resource_index" / "packages"
    index.mkdir(parents=True)
    for name in ("alpha", "beta"):
        (index / name).touch()
    scripts = {
        "greet": 'echo "hello $*"; exit 7',
        "wait": 'trap "echo caught; exit 3" INT; echo ready; while :; do sleep 0.05; done',
        "notes": "",
    }
    folder = tmp_path / "lib" / "alpha"
    folder.mkdir(parents=True)
    for name, body in scripts.items():
        (folder / name).write_text(f"#!/bin/sh\n{body}\n")
        (folder / name).chmod(0o644 if name == "notes" else 0o755)
    return tmp_path


@pytest.fixture
def ros2(prefix):
    def run(*arguments):
        ended = subprocess.run(
            command(*arguments), env=environment(prefix), capture_output=True, text=True, check=False
        )
        return ended.returncode, ended.stdout, ended.stderr

    return run


def command(*arguments):
    return [sys.executable, ROS2, *arguments]


def environment(prefix):
    return {**os.environ, "AMENT_PREFIX_PATH": str(prefix)}


def test_run_passes_arguments_and_exit_code(ros2):
    assert ros2("run", "alpha", "greet", "--flag", "--ros-args", "-p", "x:=1") == (
        7,
        "hello --flag --ros-args -p x:=1\n",
        "",
    )


def test_run_with_prefix(ros2, prefix):
    code, output, _ = ros2("run", "--prefix", "echo 'two words'", "alpha", "greet", "x")
    assert (code, output) == (0, f"two words {prefix}/lib/alpha/greet x\n")
    assert ros2("run", "--prefix", "no-such-debugger", "alpha", "greet")[0] == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("run", "gamma", "greet"), "Package 'gamma' not found"),
        (("run", "alpha", "nothing"), "No executable found"),
        (("run", "alpha", "notes"), "No executable found"),
        (("run", "beta", "greet"), "No executable found"),
        (("pkg", "executables", "gamma"), "Package 'gamma' not found"),
        (("pkg", "prefix", "gamma"), "Package not found"),
    ],
)
def test_failures_read_as_those_of_ros2cli(ros2, arguments, message):
    assert ros2(*arguments) == (1, "", message + "\n")


def test_run_refuses_to_choose_between_two(ros2, prefix):
    twin = prefix / "lib" / "alpha" / "more"
    twin.mkdir()
    (twin / "greet").symlink_to(prefix / "lib" / "alpha" / "greet")
    code, _, errors = ros2("run", "alpha", "greet")
    assert code == 1
    assert errors.startswith("Multiple executables found:\n- ")


def test_pkg(ros2, prefix):
    assert ros2("pkg", "executables") == (0, "alpha greet\nalpha wait\n", "")
    assert ros2("pkg", "executables", "beta") == (0, "", "")
    assert ros2("pkg", "executables", "--full-path", "alpha")[1].splitlines()[0] == f"{prefix}/lib/alpha/greet"
    assert ros2("pkg", "list") == (0, "alpha\nbeta\n", "")
    assert ros2("pkg", "prefix", "alpha") == (0, f"{prefix}\n", "")
    assert ros2("pkg", "prefix", "--share", "alpha") == (0, f"{prefix}/share/alpha\n", "")


def test_interrupt_reaches_the_executable(prefix):
    process = subprocess.Popen(
        command("run", "alpha", "wait"), env=environment(prefix), stdout=subprocess.PIPE, text=True
    )
    assert present(process.stdout).readline() == "ready\n"
    time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    assert process.communicate(timeout=100)[0] == "caught\n"
    assert process.returncode == 3


def test_what_it_is_not(ros2):
    code, _, errors = ros2("topic", "list")
    assert code == 2
    assert "'topic'" in errors
    assert "Jazzy installation" in errors
    code, output, _ = ros2("--help")
    assert code == 0
    assert "not ros2cli" in output
