# SPDX-License-Identifier: Apache-2.0
"""Makes the Python environment with ROS and everything else in it, from the lock files."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from bootstrap import fingerprint, host, requirements, wheels
from bootstrap.environment import NONE, SYSTEM, WHEELS, toolchain
from bootstrap.progress import Step, say
from bootstrap.work import Work


def install(work: Work) -> None:
    """Make the environment anew. Packages come out of the installer's cache when they were there before."""
    project = work.project
    host.check(project.root, work.ros, work.base)
    log = work.log("install.log")
    why = "lock file, Python, ROS or folder have changed" if work.state.install else "needed once"
    say(f"sunpoint: setting up inside this folder ({why})")
    for folder in (project.venv, project.build, project.install):
        # Scripts and CMake caches hold absolute paths and versions of what they were made with.
        if folder.exists():
            shutil.rmtree(folder)
    _make_venv(work, log)
    _install_packages(work, log)
    if work.ros == WHEELS:
        with Step("adapting the ROS packages to this machine"):
            wheels.mend_cmake_files(project.venv / "share", *_include_folders(work))
    if work.ros != NONE:
        _install_ros2(work)
    state = work.state
    state.install, state.test, state.packages = fingerprint.installation(project, work.ros), "", {}
    state.extras = {}
    state.environment = toolchain(project, work.ros)
    work.save()


def install_tests(work: Work) -> None:
    """Add the tools that only the tests need."""
    lock = work.project.root / "requirements-test.lock"
    with Step("installing the test tools") as step:
        _uv(work, step, lock, work.log("install-tests.log"), "--no-deps")
    work.state.test = fingerprint.test_requirements(work.project)
    work.save()


def install_extra(work: Work, name: str) -> None:
    """Put what one verb alone needs into a folder of its own, where it is in nobody's way."""
    folder = work.project.extra(name)
    if folder.exists():
        shutil.rmtree(folder)
    lock = work.project.root / f"requirements-{name}.lock"
    with Step(f"installing what {name} needs (once)") as step:
        _uv(work, step, lock, work.log(f"install-{name}.log"), "--no-deps", "--target", folder)
    work.state.extras[name] = fingerprint.extra_requirements(work.project, name)
    work.save()


def _make_venv(work: Work, log: Path) -> None:
    if work.ros == SYSTEM:
        command = [host.system_python(work.base), "-m", "venv", "--system-site-packages"]
    else:
        command = [getattr(sys, "_base_executable", sys.executable), "-m", "venv"]
    lock = work.project.root / "requirements-uv.lock"
    pip: list[str | Path] = [work.project.python, "-m", "pip", "install", "--ignore-installed"]
    with Step("making the Python environment") as step:
        work.run(step, [*command, work.project.venv], log)
        work.run(step, [*pip, "--disable-pip-version-check", "--require-hashes", "-r", lock], log)


def _install_packages(work: Work, log: Path) -> None:
    lock = fingerprint.lock_file(work.project, work.ros)
    # The one package that exists as source only is built with the locked setuptools too.
    options: list[str | Path] = ["--build-constraints", lock]
    if work.ros == SYSTEM:
        has_colcon = work.ask_python("import importlib.util as u; print(bool(u.find_spec('colcon_core')))")
        filtered = work.project.venv / "requirements-system.lock"
        filtered.write_text(requirements.for_system(lock.read_text(), has_colcon == "True"))
        lock, options = filtered, [*options, "--no-deps"]
    with Step("installing packages (about 300 MB to download the first time)") as step:
        _uv(work, step, lock, log, *options)


def _uv(work: Work, step: Step, lock: Path, log: Path, *options: str | Path) -> None:
    uv: list[str | Path] = [work.project.venv / "bin" / "uv", "pip", "install"]
    work.run(step, [*uv, "--python", work.project.python, "--require-hashes", "-r", lock, *options], log)


def _include_folders(work: Work) -> tuple[str, str]:
    """The include folders of Python and numpy, as the environment itself names them."""
    code = "import numpy, sysconfig; print(sysconfig.get_path('include')); print(numpy.get_include())"
    python, numpy = work.ask_python(code).splitlines()
    return python, numpy


def _install_ros2(work: Work) -> None:
    """Put a small `ros2` command into the environment when no real one is there."""
    if work.ros == SYSTEM and shutil.which("ros2", path=work.base.get("PATH")):
        return
    source = work.project.root / "tools" / "ros2.py"
    command = work.project.venv / "bin" / "ros2"
    command.write_text(
        f"#!{work.project.python}\nimport runpy\n\nrunpy.run_path({str(source)!r}, run_name='__main__')\n"
    )
    command.chmod(0o755)
