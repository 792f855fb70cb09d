# SPDX-License-Identifier: Apache-2.0
"""The verbs as they start on a machine without ROS: packages laid out as there, and every part of ROS out of reach."""

import os
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from listing import ROOT

from bootstrap import fingerprint
from bootstrap.environment import NONE
from bootstrap.layout import lay_out
from bootstrap.plan import Need
from bootstrap.project import Project, State
from bootstrap.verbs import VERBS
from bootstrap.work import Work

# What libraries choose their arithmetic by, and with it the last bits of results.
_ARITHMETIC = ("OPENBLAS_", "NPY_", "OMP_", "NUMBA_")
# What the wheels of ROS bring. `site-packages` of the tests holds them all, message packages too: those that are laid
# out come first, and of the others nothing may be taken.
ROS = re.compile("rcl.*|rosidl.*|ament.*|rpyutils|rmw.*|launch.*|ros2.*|osrf.*|.*_msgs|.*_interfaces")
"""Names of packages of ROS."""
HIDE = """
import importlib.abc
import re
import sys

ROS = re.compile({ros!r})
HERE = set({laid_out!r})


class Hidden(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        package = name.partition(".")[0]
        if ROS.fullmatch(package) and package not in HERE:
            raise ModuleNotFoundError(f"No module named {{package!r}}: there is no ROS here", name=package)
        return None


sys.meta_path.insert(0, Hidden())
"""


@dataclass(frozen=True)
class Without:
    """Where packages are laid out, and the environment that finds them there."""

    project: Project
    env: Mapping[str, str]

    def run(self, verb: str, *arguments: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
        """Run a verb to its end."""
        return run(self.project.install, self.env, verb, *arguments, cwd=cwd)


def run(install: Path, env: Mapping[str, str], verb: str, *arguments, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run the executable of a verb, of packages installed below `install`."""
    package, executable = VERBS[verb].package, VERBS[verb].executable
    command = [install / package / "lib" / package / executable, *arguments]
    typed = {**env, "SUNPOINT_VERB": f"{verb}:{executable}"}
    return subprocess.run(command, env=typed, cwd=cwd, capture_output=True, text=True, timeout=800, check=False)


def packages_laid_out(folder: Path) -> Without:
    """Lays the packages of this checkout out in a folder, for the Python of the tests with all of ROS hidden."""
    project = Project(folder, "Linux aarch64")
    for name in ("src", "config"):
        (folder / name).symlink_to(ROOT / name)
    (project.venv / "bin").mkdir(parents=True)
    project.python.symlink_to(sys.executable)
    for part in ("lib", "pyvenv.cfg"):
        (project.venv / part).symlink_to(Path(sys.prefix, part))
    work = Work(project, NONE, {}, State())
    lay_out(work, Need(True, False, fingerprint.packages(project), ()))
    return Without(project, _environment(work))


def _environment(work: Work) -> dict[str, str]:
    python = work.project.install / "python"
    hidden = work.project.root / "hidden"
    hidden.mkdir()
    laid_out = sorted(entry.name for entry in python.iterdir() if (entry / "msg").is_dir())
    (hidden / "sitecustomize.py").write_text(HIDE.format(ros=ROS.pattern, laid_out=laid_out))
    for entry in python.iterdir():
        if entry.is_symlink():
            # taken from where the tests have them, so that what is compiled is compiled once
            entry.unlink()
    names = ("PATH", "HOME", "SUNPOINT_HOME", "PYTHONPYCACHEPREFIX", "MPLBACKEND")
    kept = {name: value for name, value in os.environ.items() if name in names or name.startswith(_ARITHMETIC)}
    sources = [path for path in os.environ["PYTHONPATH"].split(os.pathsep) if str(ROOT) in path]
    return {
        **kept,
        "PYTHONPATH": os.pathsep.join([str(hidden), str(python), *sources]),
        "AMENT_PREFIX_PATH": os.pathsep.join(work.state.environment.prepend["AMENT_PREFIX_PATH"]),
    }
