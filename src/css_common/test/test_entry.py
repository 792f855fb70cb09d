# SPDX-License-Identifier: Apache-2.0
"""How an installed executable ends: with the exit code of its `main`, whatever is still there at the end."""

import subprocess
import sys

import pytest

MODULE = """
import atexit, os, signal

atexit.register(lambda: print("registered", flush=True))


class Left:
    def __del__(self, kill=os.kill, own=os.getpid(), crash=signal.SIGSEGV):
        kill(own, crash)  # as a thread of the middleware that meets what is no longer there


left = Left()


def main():
    {ros}
    print("done")
    return {code}
"""
START = "import sys; sys.argv = ['lib/{package}/{name}']; from css_common.entry import main; sys.exit(main())"


@pytest.fixture
def run(tmp_path, monkeypatch):
    def of(folder: str, ros: str, code: int) -> subprocess.CompletedProcess[str]:
        package = tmp_path / "a_package" / folder
        package.mkdir(parents=True)
        (tmp_path / "a_package" / "__init__.py").touch()
        (package / "__init__.py").touch()
        (package / "thing.py").write_text(MODULE.format(ros=ros, code=code))
        monkeypatch.syspath_prepend(tmp_path)
        monkeypatch.setenv("PYTHONPATH", ":".join([str(tmp_path), *filter(None, sys.path)]))
        command = START.format(package="a_package", name="thing")
        return subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, check=False)

    return of


@pytest.mark.parametrize("code", [0, 1, 3])
def test_a_command_that_had_ros_ends_with_its_own_code(run, code):
    done = run("commands", "import rclpy", code)
    assert done.returncode == code, done.stderr
    assert done.stdout.splitlines() == ["done", "registered"]


@pytest.mark.parametrize("code", [0, 2])
def test_a_node_ends_with_its_own_code(run, code):
    done = run("nodes", "import rclpy", code)
    assert done.returncode == code, done.stderr
    assert done.stdout.splitlines() == ["done"]


def test_only_ros_spares_the_end_of_the_interpreter(run):
    done = run("commands", "pass", 0)
    assert done.returncode == -11
