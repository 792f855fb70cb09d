# SPDX-License-Identifier: Apache-2.0
"""Checks, before a first installation, that the machine has what it needs, and says what to do if not."""

from __future__ import annotations

import importlib.util
import os
import shutil
import sys
import sysconfig
from collections.abc import Mapping
from pathlib import Path

from bootstrap.environment import NONE, SYSTEM
from bootstrap.project import Refusal

OLDEST_PYTHON, NEWEST_PYTHON = (3, 11), (3, 13)
OLDEST_GLIBC = (2, 28)  # manylinux_2_28, what the ROS wheels are built for


def check_python_version() -> None:
    """Raises Refusal when an operating system upgrade has changed the Python below `.venv` to an unknown one."""
    if not OLDEST_PYTHON <= sys.version_info[:2] <= NEWEST_PYTHON:
        raise Refusal(
            f"the Python of .venv has become {sys.version.split()[0]}; packages exist for 3.11 to 3.13",
            "rm -r .venv   and run it again; it then looks for a suitable python3",
        )


def check_compiler(env: Mapping[str, str]) -> None:
    """Raises Refusal when no C++ compiler is there to build the messages."""
    named = env.get("CXX", "").split()
    candidates = named[:1] or ["c++", "g++", "clang++"]
    if not any(shutil.which(name, path=env.get("PATH")) for name in candidates):
        raise Refusal(
            f"no C++ compiler found (looked for {', '.join(candidates)}); the messages are compiled once",
            "sudo apt install g++",
        )


def check_python_headers(include: str) -> None:
    """Raises Refusal when the header files of this Python are not installed."""
    if not Path(include, "Python.h").is_file():
        version = f"{sys.version_info[0]}.{sys.version_info[1]}"
        raise Refusal(
            f"Python.h is not in {include}; the messages are compiled against it",
            f"sudo apt install python3-dev   (or python{version}-dev)",
        )


def check_venv_module() -> None:
    """Raises Refusal when Python cannot make virtual environments, as Debian ships it by default."""
    missing = [name for name in ("venv", "ensurepip") if importlib.util.find_spec(name) is None]
    if missing:
        raise Refusal(
            f"this Python ({sys.version.split()[0]}) lacks {' and '.join(missing)}",
            "sudo apt install python3-venv",
        )


def check_libc() -> None:
    """Raises Refusal on a C library for which no wheels are built."""
    try:
        name, version = (os.confstr("CS_GNU_LIBC_VERSION") or "").split()
        suitable = tuple(map(int, version.split("."))) >= OLDEST_GLIBC
    except ValueError:
        name, version, suitable = "another C library than glibc", "", False
    if not suitable:
        raise Refusal(
            f"the packages need glibc 2.28 or newer; here is {name} {version}",
            "use Debian 10, Ubuntu 20.04, RHEL 8 or newer, or a container of one",
        )


def system_python(env: Mapping[str, str]) -> str:
    """The interpreter that the sourced ROS installation was made for. Raises Refusal when it is not there."""
    prefixes = env.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    for prefix in prefixes:
        for library in sorted(Path(prefix, "lib").glob("python3.*/site-packages/rclpy")):
            name = library.parts[-3]
            python = shutil.which(name, path=env.get("PATH"))
            if python:
                return python
            raise Refusal(
                f"the sourced ROS in {prefix} is for {name}, which is not on PATH", f"sudo apt install {name}"
            )
    raise Refusal(
        "ROS_DISTRO=jazzy is set, but no rclpy lies in any AMENT_PREFIX_PATH folder",
        "sudo apt install ros-jazzy-ros-base   or open a shell that sources no ROS",
    )


def check_folder(root: Path) -> None:
    """Raises Refusal for a folder name that lists of paths or the first lines of scripts cannot hold."""
    if any(character in str(root) for character in " :;'\"$"):
        raise Refusal(
            f"the path {root} contains a space or one of : ; ' \" $, which ROS build tools cannot handle",
            "move the project folder to a plain path",
        )


def check(root: Path, ros: str, env: Mapping[str, str]) -> None:
    """Raises Refusal naming the first thing that is missing."""
    check_python_version()
    check_folder(root)
    if ros == SYSTEM:
        system_python(env)
    elif sys.platform == "linux":
        check_libc()
    check_venv_module()
    if ros == NONE:
        return
    check_compiler(env)
    check_python_headers(sysconfig.get_path("include", "posix_prefix"))
