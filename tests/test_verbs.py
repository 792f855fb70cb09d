# SPDX-License-Identifier: Apache-2.0
"""Every verb of ./sunpoint and every node answers --help, from its installed executable."""

import os
import subprocess
from pathlib import Path

import pytest
from ament_index_python.packages import get_package_prefix

from bootstrap.verbs import VERBS

ROOT = Path(__file__).parents[1]
NODES = sorted(
    (file.parts[-3], file.stem) for file in ROOT.glob("src/*/*/nodes/[a-z]*.py") if not file.stem.startswith("_")
)


def _help(package: str, executable: str) -> str:
    path = Path(get_package_prefix(package)) / "lib" / package / executable
    assert os.access(path, os.X_OK), f"{package} {executable} is not installed"
    done = subprocess.run([path, "--help"], capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("verb", sorted(name for name, verb in VERBS.items() if verb.package))
def test_verb_is_installed_and_explains_itself(verb):
    entry = VERBS[verb]
    assert "usage" in _help(entry.package, entry.executable).lower()


@pytest.mark.parametrize(("package", "executable"), NODES)
def test_node_explains_itself(package, executable):
    assert len(_help(package, executable).splitlines()) > 5
