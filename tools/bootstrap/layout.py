# SPDX-License-Identifier: Apache-2.0
"""Lays the packages out where there is no ROS to build them with: links, executables and marks, nothing compiled.

What verbs find is what colcon's build with links leaves, as far as they need it: `install/PACKAGE/lib/PACKAGE/NAME` for
each executable, marks in the ament index, definitions of messages, and `install/python` for imports. Message packages
there make their classes from the definitions (`css_common.message_classes`).
"""

from __future__ import annotations

import re
import runpy
import shutil
import sys
import types
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bootstrap import fingerprint
from bootstrap.environment import toolchain
from bootstrap.plan import Need
from bootstrap.progress import Step
from bootstrap.project import Environment, Project
from bootstrap.work import Work

_MARKS = "share/ament_index/resource_index/packages"
_EXECUTABLE = """#!{python}
import sys

from {module} import {function}

sys.exit({function}())
"""
_MESSAGES = '''"""Messages of {package}, made from their definitions."""

from css_common.message_classes import classes_of

globals().update(classes_of("{package}"))
'''


def lay_out(work: Work, need: Need) -> None:
    """Lay out what changed, forget what is gone."""
    project, state = work.project, work.state
    with Step("laying out the packages"):
        for name in {*need.removed, *need.packages}:
            state.packages.pop(name, None)
            shutil.rmtree(project.install / name, ignore_errors=True)
            link = _python(project) / name
            shutil.rmtree(link) if link.is_dir() and not link.is_symlink() else link.unlink(missing_ok=True)
            for metadata in _python(project).glob(f"{name}-*.dist-info"):
                shutil.rmtree(metadata)
        work.save()
        for name, value in need.packages.items():
            _lay_out_package(project, name)
            state.packages[name] = value
    state.environment = _environment(work)
    work.save()


def _python(project: Project) -> Path:
    return project.install / "python"


def _lay_out_package(project: Project, name: str) -> None:
    folder, prefix = project.source / name, project.install / name
    (prefix / "share").mkdir(parents=True)
    _python(project).mkdir(exist_ok=True)
    if fingerprint.has_interfaces(folder):
        _lay_out_messages(project, prefix, name, folder)
        for other in sorted(path for path in fingerprint.common_interfaces(project).iterdir() if path.is_dir()):
            _lay_out_messages(project, prefix, other.name, other)
        return
    _link(_python(project) / name, folder / name)
    told = _told_by(folder / "setup.py")
    _write_metadata(_python(project), told)
    for place, files in told["data_files"]:
        for file in files:
            (prefix / place).mkdir(parents=True, exist_ok=True)
            _link(prefix / place / Path(file).name, folder / file)
    for line in told["entry_points"]["console_scripts"]:
        executable, module, function = re.fullmatch(r"(\w+) = ([\w.]+):(\w+)", line).groups()  # type: ignore[union-attr]
        file = prefix / "lib" / name / executable
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(_EXECUTABLE.format(python=project.python, module=module, function=function))
        file.chmod(0o755)


def _lay_out_messages(project: Project, prefix: Path, package: str, folder: Path) -> None:
    (prefix / "share" / package).mkdir()
    _link(prefix / "share" / package / "msg", folder / "msg")
    mark = prefix / _MARKS / package
    mark.parent.mkdir(parents=True, exist_ok=True)
    mark.touch()
    module = _python(project) / package / "msg" / "__init__.py"
    module.parent.mkdir(parents=True, exist_ok=True)
    (module.parent.parent / "__init__.py").touch()
    module.write_text(_MESSAGES.format(package=package))


def _link(link: Path, target: Path) -> None:
    link.unlink(missing_ok=True)
    link.symlink_to(target)


def _told_by(setup_file: Path) -> dict[str, Any]:
    """What a `setup.py` tells setuptools, heard by a stand-in: nothing of it is built here."""
    told: dict[str, Any] = {}
    listener = types.ModuleType("setuptools")
    listener.__dict__.update(setup=lambda **given: told.update(given), find_packages=lambda **_: [])
    before = {name: sys.modules.pop(name, None) for name in ("setuptools", "css_common.packaging")}
    sys.modules["setuptools"] = listener
    try:
        runpy.run_path(str(setup_file))
    finally:
        for name, module in before.items():
            sys.modules.pop(name, None)
            if module is not None:
                sys.modules[name] = module
    return told


def _write_metadata(python: Path, told: Mapping[str, Any]) -> None:
    """What `importlib.metadata` reads: recordings tell the versions of the packages."""
    folder = python / f"{told['name']}-{told['version']}.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {told['name']}\nVersion: {told['version']}\n")


def _environment(work: Work) -> Environment:
    project = work.project
    tools = toolchain(project, work.ros)
    prefixes = [str(project.install / name) for name in sorted(work.state.packages)]
    own = {"AMENT_PREFIX_PATH": prefixes, "PYTHONPATH": [str(_python(project))]}
    return Environment(assign=tools.assign, prepend={**tools.prepend, **own})
