# SPDX-License-Identifier: Apache-2.0
"""Every verb of ./sunpoint and every node answers --help, from its installed executable."""

import os
import signal
import subprocess
from pathlib import Path

import pytest
from ament_index_python.packages import get_package_prefix

from bootstrap.verbs import VERBS

ROOT = Path(__file__).parents[1]
NODES = sorted(
    (file.parts[-3], file.stem) for file in ROOT.glob("src/*/*/nodes/[a-z]*.py") if not file.stem.startswith("_")
)


def _executable(package: str, executable: str) -> Path:
    path = Path(get_package_prefix(package)) / "lib" / package / executable
    assert os.access(path, os.X_OK), f"{package} {executable} is not installed"
    return path


def _help(package: str, executable: str) -> str:
    command = [_executable(package, executable), "--help"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("verb", sorted(name for name, verb in VERBS.items() if verb.package))
def test_verb_is_installed_and_explains_itself(verb):
    entry = VERBS[verb]
    assert "usage" in _help(entry.package, entry.executable).lower()


@pytest.mark.parametrize(("package", "executable"), NODES)
def test_node_explains_itself(package, executable):
    assert len(_help(package, executable).splitlines()) > 5


SOME = [("css_estimation", "ekf"), ("css_recording", "recorder"), ("css_bringup", "fly"), ("css_studies", "coverage")]


@pytest.mark.parametrize(("package", "executable"), SOME)
def test_help_that_nobody_reads_is_no_error(package, executable):
    process = subprocess.Popen(
        [_executable(package, executable), "--help"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    process.stdout.close()
    _, err = process.communicate(timeout=100)
    assert (process.returncode, err) == (0, b"")


@pytest.mark.parametrize("library", ["numpy", "llvmlite"])
@pytest.mark.parametrize(("package", "executable"), SOME)
def test_an_interrupt_while_libraries_load_says_nothing(package, executable, library):
    arguments = ["--ros-args"] if executable == "ekf" else ["--help"]
    process = subprocess.Popen(
        [_executable(package, executable), *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    loaded = Path(f"/proc/{process.pid}/maps")
    while process.poll() is None and library not in loaded.read_text():
        pass
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=100)
    assert process.returncode in (-signal.SIGINT, 130, 0)
    assert err == b""
