# SPDX-License-Identifier: Apache-2.0
"""Composes the environment in which verbs run, without sourcing anything."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping

from bootstrap.project import Environment, Project, Refusal
from css_common import places

DISTRIBUTION = "jazzy"
WHEELS = "wheels"
SYSTEM = "system"
NONE = "none"
MACHINE = "SUNPOINT_MACHINE"
WITH_WHEELS = "Linux x86_64"
"""The machine for which ROS 2 exists as wheels."""
WHEELS_GUARD = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"


def machine_of(env: Mapping[str, str]) -> str:
    """What `uname -sm` said when `./sunpoint` asked it, else what Python knows of it."""
    here = os.uname()
    return env.get(MACHINE) or f"{here.sysname} {here.machine}"


def without_other_sunpoint(env: Mapping[str, str]) -> dict[str, str]:
    """The environment without what an enclosing `./sunpoint shell` added, of this folder or another."""
    env = {name: value for name, value in env.items() if name != MACHINE}
    home = env.get("SUNPOINT_HOME")
    if not home:
        return env
    cleaned = {}
    for name, value in env.items():
        parts = value.split(os.pathsep)
        kept = [part for part in parts if part != home and not part.startswith(home + os.sep)]
        if kept:
            cleaned[name] = os.pathsep.join(kept)
    if env.get("SUNPOINT_ROS") == WHEELS:
        for name in ("ROS_DISTRO", WHEELS_GUARD):
            cleaned.pop(name, None)
    return cleaned


def without_foreign_python(env: Mapping[str, str]) -> tuple[dict[str, str], list[str]]:
    """The environment with only those folders of PYTHONPATH that belong to a sourced ROS or workspace; the others.

    Modules in PYTHONPATH stand before the environment's own, so that a stranger's numpy.py would take numpy's place.
    """
    cleaned = dict(env)
    entries = [entry for entry in cleaned.pop("PYTHONPATH", "").split(os.pathsep) if entry]
    sourced = [os.path.join(prefix, "") for prefix in _prefixes(env)]
    kept = [entry for entry in entries if os.path.join(entry, "").startswith(tuple(sourced))]
    if kept:
        cleaned["PYTHONPATH"] = os.pathsep.join(kept)
    return cleaned, [entry for entry in entries if entry not in kept]


def _prefixes(env: Mapping[str, str]) -> Iterator[str]:
    for name in ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH", "COLCON_PREFIX_PATH"):
        yield from filter(None, env.get(name, "").split(os.pathsep))
    for install in filter(None, env.get("COLCON_PREFIX_PATH", "").split(os.pathsep)):
        yield os.path.join(os.path.dirname(install.rstrip(os.sep)), "build")  # of --symlink-install


def ros_source(env: Mapping[str, str], machine: str) -> str:
    """Where ROS 2 comes from: `system` when a Jazzy installation is sourced, `wheels` where there are any, else `none`.

    Args:
        env: the user's environment.
        machine: what `uname -sm` says, e.g. "Linux aarch64".

    Raises Refusal when another distribution is sourced: its messages and libraries do not mix with Jazzy's.
    """
    distribution = env.get("ROS_DISTRO", "")
    if distribution not in ("", DISTRIBUTION):
        raise Refusal(
            f"ROS 2 {distribution} is sourced in this shell; Sunpoint is for {DISTRIBUTION}",
            "open a shell that sources no ROS, or: source /opt/ros/jazzy/setup.bash",
        )
    if distribution and env.get("AMENT_PREFIX_PATH"):
        return SYSTEM
    return WHEELS if machine == WITH_WHEELS else NONE


def toolchain(project: Project, ros: str) -> Environment:
    """The environment of the installed tools and ROS, before any package of the workspace is built."""
    root, venv = project.root, project.venv
    environment = Environment(
        assign={"SUNPOINT_HOME": str(root), "SUNPOINT_ROS": ros, "VIRTUAL_ENV": str(venv)},
        prepend={"PATH": [str(venv / "bin")]},
    )
    if ros != NONE:
        environment.assign |= {"ROS_DISTRO": DISTRIBUTION, "ROS_VERSION": "2", "ROS_PYTHON_VERSION": "3"}
    if ros == WHEELS:
        # The wheels' start hook executes Python a second time to set LD_LIBRARY_PATH, unless told it is set.
        environment.assign[WHEELS_GUARD] = "1"
        site_packages = venv / "lib" / f"python{sys.version_info[0]}.{sys.version_info[1]}" / "site-packages"
        libraries = sorted(str(folder) for folder in site_packages.glob("ros_*.libs"))
        environment.prepend["LD_LIBRARY_PATH"] = [str(venv / "lib"), *libraries]
        environment.prepend["AMENT_PREFIX_PATH"] = [str(venv)]
        environment.prepend["CMAKE_PREFIX_PATH"] = [str(venv)]
    return environment


def compose(base: Mapping[str, str], environment: Environment) -> dict[str, str]:
    """The user's environment with the changes applied, and defaults for what the user left open."""
    env = dict(base)
    env.pop("PYTHONHOME", None)
    env.update(environment.assign)
    for name, entries in environment.prepend.items():
        rest = [part for part in env.get(name, "").split(os.pathsep) if part and part not in entries]
        env[name] = os.pathsep.join([*entries, *rest])
    if not {"ROS_HOME", "ROS_LOG_DIR"} <= env.keys():
        logs = places.logs(env)
        env.setdefault("ROS_HOME", str(logs))
        env.setdefault("ROS_LOG_DIR", str(logs / "ros"))
    # Containers switch bytecode off to keep their layers small; compiling numba, scipy and matplotlib from source at
    # every start costs seconds. Kept apart, it litters no folder, and one that is read-only has bytecode all the same.
    env.pop("PYTHONDONTWRITEBYTECODE", None)
    env["PYTHONPYCACHEPREFIX"] = str(places.scratch("bytecode", env))
    env.setdefault("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp")
    env.setdefault("MPLBACKEND", "Agg")
    return env


def changes(before: Mapping[str, str], after: Mapping[str, str]) -> Environment:
    """What turns `before` into `after`; values that are lists of absolute paths become entries to prepend."""
    environment = Environment()
    for name, value in after.items():
        if value == before.get(name) or name in ("PWD", "OLDPWD", "SHLVL", "_"):
            continue
        parts = [part for part in value.split(os.pathsep) if part]
        if name.endswith("PATH") and all(part.startswith(os.sep) for part in parts):
            old = before.get(name, "").split(os.pathsep)
            environment.prepend[name] = [part for part in parts if part not in old]
        else:
            environment.assign[name] = value
    return environment
