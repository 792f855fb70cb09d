# SPDX-License-Identifier: Apache-2.0
"""What installing and building share: the state they change and how they run commands."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from bootstrap.environment import compose, toolchain
from bootstrap.progress import CommandFailed, Step, run
from bootstrap.project import Project, Refusal, State

NETWORK_SIGNS = (
    "error sending request",
    "Failed to fetch",
    "Failed to download",
    "dns error",
    "NewConnectionError",
    "name resolution",
    "Network is unreachable",
    "Connection refused",
    "timed out",
    "No matching distribution found for uv",
)
DISK_SIGNS = ("No space left on device", "Disk quota exceeded")
FULL = 20_000_000  # [bytes] free space below which a failure is put down to the disk, whatever it says


def disk_full(project: Project) -> Refusal:
    """The message for a full disk."""
    return Refusal(f"no space left on the disk of {project.root}", "free 2 GB, then run it again")


@dataclass
class Work:
    """One pass over a workspace; `state` is saved after each part that succeeded."""

    project: Project
    ros: str
    base: Mapping[str, str]
    state: State

    @property
    def env(self) -> dict[str, str]:
        """The environment for installing and building: tools and ROS, no package of the workspace."""
        quiet = {"UV_NO_PROGRESS": "1", "NO_COLOR": "1", "COLCON_DEFAULTS_FILE": os.devnull}
        # Without it colcon counts its own compilers as load and keeps one of two processors idle.
        jobs = {"MAKEFLAGS": f"-j{os.cpu_count()}"}
        return {**jobs, **compose(self.base, toolchain(self.project, self.ros)), **quiet}

    def save(self) -> None:
        """Remember what has been done so far."""
        self.state.save(self.project.state_file)

    def log(self, name: str) -> Path:
        """An emptied log file."""
        file = self.project.logs / name
        file.write_bytes(b"")
        return file

    def run(self, step: Step, command: Sequence[str | Path], log: Path) -> None:
        """Run one command. Raises Refusal that tells the user why it failed."""
        try:
            run(step, command, self.env, self.project.root, log)
        except CommandFailed as failure:
            raise self.explained(failure) from None

    def explained(self, failure: CommandFailed) -> Refusal:
        """The failure of a command as a message: a known cause by name, else the end of its output."""
        log = failure.log.relative_to(self.project.root)
        free = shutil.disk_usage(self.project.root).free
        if free < FULL or any(sign in failure.output for sign in DISK_SIGNS):
            return disk_full(self.project)
        if any(sign in failure.output for sign in NETWORK_SIGNS):
            return Refusal(
                f"the package index (PyPI) could not be reached; {log} has the details",
                "check the network or proxy (HTTPS_PROXY), then run it again; what was downloaded is kept",
            )
        return Refusal(f"the end of {log}:\n{failure.output}")

    def ask_python(self, code: str) -> str:
        """What a line of code prints in the environment's Python."""
        return subprocess.check_output([self.project.python, "-c", code], env=self.env, text=True).strip()
