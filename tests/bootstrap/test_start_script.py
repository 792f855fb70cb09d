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


@pytest.mark.parametrize("machine", ["Linux x86_64", "Linux aarch64", "Darwin arm64", "Darwin x86_64"])
def test_hands_the_machine_over(start, machine):
    shown = SUITABLE.replace("started", "on $SUNPOINT_MACHINE started")
    code, output, errors = start("fly", uname=f'echo "{machine}"', python3=shown)
    assert (code, errors) == (0, "")
    assert output.startswith(f"on {machine} started")


def test_a_mac_without_python_is_told_of_one_for_macs(start):
    code, _, errors = start("fly", uname='echo "Darwin arm64"')
    assert code == 1
    assert "brew install" in errors


@pytest.mark.parametrize("machine", ["Linux riscv64", "Linux armv7l", "FreeBSD amd64"])
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


# what an older Mac has: no options, one link at a time
BSD_READLINK = 'case "$1" in -*) exit 1;; esac; exec {} "$1"'


@pytest.mark.parametrize("readlink", [None, BSD_READLINK], ids=["gnu", "bsd"])
def test_finds_its_folder_through_symbolic_links(start, tmp_path, readlink):
    fakes = {"readlink": readlink.format(shutil.which("readlink"))} if readlink else {}
    folder = tmp_path / "a folder"
    folder.symlink_to("project")
    (tmp_path / "relative").symlink_to("a folder/sunpoint")
    (tmp_path / "absolute").symlink_to(tmp_path / "relative")
    for link in ("relative", "absolute", "a folder/sunpoint"):
        _, output, errors = start(script=tmp_path / link, python3=SUITABLE, **fakes)
        assert errors == ""
        assert f"{tmp_path}/project/tools/bootstrap" in output


def test_finds_its_folder_when_its_name_is_all_that_the_shell_was_given(tmp_path):
    (tmp_path / "bin").mkdir()
    python = tmp_path / "bin" / "python3"
    python.write_text(f"#!/bin/sh\n{SUITABLE}\n")
    python.chmod(0o755)
    shutil.copy(ROOT / "sunpoint", tmp_path)
    (tmp_path / "link").symlink_to("sunpoint")
    for name in ("sunpoint", "link"):
        env = {"PATH": f"{tmp_path}/bin:{os.environ['PATH']}"}
        output = subprocess.check_output(["sh", name, "fly"], cwd=tmp_path, env=env, text=True)
        assert output.endswith(f"{tmp_path}/tools/bootstrap fly\n")


def test_script_is_portable_shell():
    shell = shutil.which("dash")
    if shell is None:
        pytest.skip("no dash here")
    assert subprocess.run([shell, "-n", ROOT / "sunpoint"], check=False).returncode == 0
    assert os.access(ROOT / "sunpoint", os.X_OK)
