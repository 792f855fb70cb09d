# SPDX-License-Identifier: Apache-2.0
"""Builds the packages of the workspace with colcon and records the environment they need."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

from bootstrap import fingerprint
from bootstrap.environment import changes, compose, toolchain
from bootstrap.plan import Need
from bootstrap.progress import Step
from bootstrap.project import Environment, Refusal
from bootstrap.work import Work

# colcon run by the environment's Python: the executables it installs start with the Python that runs it,
# which for a colcon script of the system is the system's.
COLCON = "import sys; from colcon_core.command import main; sys.exit(main())"
OPTIONS = (
    *("--base-paths", "src", "--symlink-install"),
    *("--event-handlers", "console_direct+", "desktop_notification-", "terminal_title-", "status-"),
    *("--cmake-args", "-DCMAKE_BUILD_TYPE=Release", "-DBUILD_TESTING=OFF", "-GNinja"),
)


FAILED = "failed"
"""In place of a fingerprint: built before, failed since, and what is there is good to continue from."""


def build(work: Work, need: Need) -> None:
    """Build what changed, forget what is gone. Raises Refusal with the end of colcon's output."""
    state = work.state
    for name in need.removed:
        _discard(work, name)
        del state.packages[name]
    known = [name for name in need.packages if state.packages.pop(name, None)]
    # Forgotten before it is touched, so that an interrupted build counts as none.
    work.save()
    for name in need.packages:
        if name in known:
            # Executables whose source is gone would stay.
            shutil.rmtree(work.project.executable(name, "any").parent, ignore_errors=True)
            _result_file(work, name).unlink(missing_ok=True)
        else:
            _discard(work, name)
    if need.packages:
        _colcon(work, need.packages, known)
    state.environment = _environment(work)
    work.save()


def _colcon(work: Work, wanted: Mapping[str, str], known: Sequence[str]) -> None:
    log = work.log("build.log")
    label = f"building {', '.join(wanted)}" if work.state.packages else "building the ROS packages"
    command: list[str | Path] = [work.project.python, "-c", COLCON, "--log-base", "log/colcon", "build"]
    command += [*_selection(work, list(wanted)), *OPTIONS]
    with Step(label) as step:
        try:
            work.run(step, command, log)
        except Refusal:
            work.state.packages.update(dict.fromkeys(known, FAILED))
            raise
        finally:
            work.state.packages.update({name: wanted[name] for name in wanted if _succeeded(work, name)})
            work.save()
    if missing := [name for name in wanted if not _succeeded(work, name)]:
        where = log.relative_to(work.project.root)
        raise Refusal(f"colcon did not build {', '.join(missing)}", f"the whole output is in {where}")


def _selection(work: Work, names: list[str]) -> list[str]:
    """colcon's options that limit a build to what changed; messages take along what is made from them."""
    if not work.state.packages:
        return []
    above = any(fingerprint.has_interfaces(work.project.source / name) for name in names)
    return ["--packages-above" if above else "--packages-select", *names]


def _result_file(work: Work, name: str) -> Path:
    """Where colcon leaves the exit code of a package's build."""
    return work.project.build / name / "colcon_build.rc"


def _succeeded(work: Work, name: str) -> bool:
    file = _result_file(work, name)
    return file.is_file() and file.read_text().strip() == "0"


def _discard(work: Work, name: str) -> None:
    for folder in (work.project.build, work.project.install):
        shutil.rmtree(folder / name, ignore_errors=True)


def _environment(work: Work) -> Environment:
    """What sourcing `install/local_setup.sh` adds to the environment of the tools."""
    tools = toolchain(work.project, work.ros)
    script = work.project.install / "local_setup.sh"
    if not script.is_file():
        return tools
    before = compose(work.base, tools)
    code = "import json, os; print(json.dumps(dict(os.environ)))"
    source = f'. "{script}" >&2 && exec "$0" -I -S -c "{code}"'
    after = json.loads(subprocess.check_output(["sh", "-c", source, work.project.python], env=before))
    added = changes(before, after)
    prepend = dict(added.prepend)
    for name, entries in tools.prepend.items():
        prepend[name] = [*prepend.get(name, []), *entries]
    return Environment(assign={**tools.assign, **added.assign}, prepend=prepend)
