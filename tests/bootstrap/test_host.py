# SPDX-License-Identifier: Apache-2.0
"""Each missing thing is refused by name, with the command that installs it."""

import importlib.util
import os
import sys
from pathlib import Path

import pytest

from bootstrap import host
from bootstrap.project import Refusal


def program(folder, name):
    folder.mkdir(exist_ok=True)
    file = folder / name
    file.write_text("#!/bin/sh\n")
    file.chmod(0o755)
    return str(file)


def refused(check, *arguments):
    with pytest.raises(Refusal) as refusal:
        check(*arguments)
    return str(refusal.value), refusal.value.remedy


def test_compiler(tmp_path):
    problem, remedy = refused(host.check_compiler, {"PATH": str(tmp_path)})
    assert "C++ compiler" in problem
    assert remedy == "sudo apt install g++"
    program(tmp_path, "clang++")
    host.check_compiler({"PATH": str(tmp_path)})
    assert "special-g++" in refused(host.check_compiler, {"PATH": str(tmp_path), "CXX": "special-g++ -m64"})[0]


def test_python_headers(tmp_path):
    problem, remedy = refused(host.check_python_headers, str(tmp_path))
    assert "Python.h" in problem
    assert "python3-dev" in remedy
    (tmp_path / "Python.h").touch()
    host.check_python_headers(str(tmp_path))


def test_venv_module(monkeypatch):
    host.check_venv_module()
    real = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "ensurepip" else real(name))
    problem, remedy = refused(host.check_venv_module)
    assert "lacks ensurepip" in problem
    assert remedy == "sudo apt install python3-venv"


def test_python_version(monkeypatch):
    host.check_python_version()
    monkeypatch.setattr(sys, "version_info", (3, 14, 0))
    assert ".venv" in refused(host.check_python_version)[1]


@pytest.mark.parametrize(("answer", "suitable"), [("glibc 2.36", True), ("glibc 2.17", False), (None, False)])
def test_c_library(monkeypatch, answer, suitable):
    monkeypatch.setattr(os, "confstr", lambda _name: answer)
    if suitable:
        host.check_libc()
    else:
        assert "glibc 2.28 or newer" in refused(host.check_libc)[0]


@pytest.mark.parametrize("name", ["with space", "with:colon", "with$sign"])
def test_folder_name(name):
    assert "plain path" in refused(host.check_folder, Path("/home/me", name))[1]


def test_sourced_installation_decides_on_its_own_python(tmp_path):
    ros = tmp_path / "jazzy"
    env = {"AMENT_PREFIX_PATH": f"{tmp_path}/overlay:{ros}", "PATH": str(tmp_path / "bin")}
    assert "no rclpy" in refused(host.system_python, env)[0]
    (ros / "lib" / "python3.12" / "site-packages" / "rclpy").mkdir(parents=True)
    assert refused(host.system_python, env)[1] == "sudo apt install python3.12"
    python = program(tmp_path / "bin", "python3.12")
    assert host.system_python(env) == python
