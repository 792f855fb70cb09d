# SPDX-License-Identifier: Apache-2.0
"""The shell script `sunpoint`: which machines and Pythons it refuses, and which Python it takes."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SUITABLE = 'case "$*" in *"sys.exit(not"*) exit 0;; *) echo "started $0 $*";; esac'
TOO_OLD = 'case "$*" in *--version*) echo "Python 3.9.18";; *) exit 1;; esac'
LEFT_OVER = 'echo "this version is not installed" >&2; exit 127'


@pytest.fixture
def start(tmp_path):
    """Run a copy of the script with only the given programs on PATH; returns (code, output, errors)."""
    programs = tmp_path / "bin"
    programs.mkdir()
    for name in ("sh", "readlink", "uname"):
        (programs / name).symlink_to(shutil.which(name))
    script = tmp_path / "project" / "sunpoint"
    script.parent.mkdir()
    shutil.copy(ROOT / "sunpoint", script)

    def run(*arguments, script=script, **fakes):
        for name, body in fakes.items():
            file = programs / name.replace("_", ".")
            file.unlink(missing_ok=True)
            file.write_text(f"#!/bin/sh\n{body}\n")
            file.chmod(0o755)
        ended = subprocess.run(
            [script, *arguments], env={"PATH": str(programs)}, capture_output=True, text=True, check=False
        )
        return ended.returncode, ended.stdout, ended.stderr

    return run


def test_takes_python3_when_it_is_suitable(start):
    code, output, errors = start("fly", "a b", python3=SUITABLE)
    assert (code, errors) == (0, "")
    assert "/bin/python3 -I -S" in output
    assert output.endswith("/project/tools/bootstrap fly a b\n")


def test_passes_over_pythons_that_are_too_old_or_do_not_start(start):
    code, output, _ = start(python3=TOO_OLD, python3_13=LEFT_OVER, python3_12=SUITABLE)
    assert code == 0
    assert "/bin/python3.12 -I -S" in output


@pytest.mark.parametrize(
    ("fakes", "found"), [({"python3": TOO_OLD}, "Python 3.9.18"), ({}, "none")], ids=["old", "none"]
)
def test_refuses_without_suitable_python(start, fakes, found):
    code, output, errors = start("fly", **fakes)
    assert (code, output) == (1, "")
    assert errors.splitlines()[0] == f"sunpoint: needs CPython 3.11, 3.12 or 3.13; python3 here: {found}"
    assert "sudo apt install python3" in errors.splitlines()[1]


@pytest.mark.parametrize("machine", ["Linux aarch64", "Darwin x86_64"])
def test_refuses_other_machines(start, machine):
    code, output, errors = start("fly", uname=f'echo "{machine}"', python3=SUITABLE)
    assert (code, output) == (1, "")
    assert machine in errors
    assert len(errors.splitlines()) == 2


def test_keeps_the_python_of_an_installed_environment(start, tmp_path):
    python = tmp_path / "project" / ".venv" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.write_text('#!/bin/sh\necho "environment $*"\n')
    python.chmod(0o755)
    code, output, _ = start("fly", python3=SUITABLE)
    assert code == 0
    assert output.startswith("environment -I -S")


def test_finds_its_folder_through_a_symbolic_link(start, tmp_path):
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "project" / "sunpoint")
    _, output, _ = start(script=link, python3=SUITABLE)
    assert f"{tmp_path}/project/tools/bootstrap" in output


def test_script_is_portable_shell():
    shell = shutil.which("dash")
    if shell is None:
        pytest.skip("no dash here")
    assert subprocess.run([shell, "-n", ROOT / "sunpoint"], check=False).returncode == 0
    assert os.access(ROOT / "sunpoint", os.X_OK)
