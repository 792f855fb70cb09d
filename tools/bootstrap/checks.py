# SPDX-License-Identifier: Apache-2.0
"""The verbs `test` and `lint`: ruff, mypy and pytest in the project's environment."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Iterable, Mapping

from bootstrap.project import Project

STYLE = (["ruff", "check"], ["ruff", "format", "--check"])
TYPES = ["mypy"]


def failing_linters(project: Project, env: Mapping[str, str], linters: Iterable[list[str]]) -> list[str]:
    """Run linters with their output shown; the names of those that complain."""
    failing = []
    for linter in linters:
        began = time.monotonic()
        print(f"== {' '.join(linter)}", flush=True)
        if subprocess.call([project.python, "-m", *linter], env=env, cwd=project.root):
            failing.append(linter[0])
        print(f"   {time.monotonic() - began:.1f} s", flush=True)
    return failing


def pytest_command(project: Project, arguments: list[str], failing: list[str]) -> list[str]:
    """The command that runs the tests, and fails in the end for the linters that failed before it."""
    pytest = [str(project.python), "-m", "pytest", *arguments]
    if not failing:
        return pytest
    print(f"== {' and '.join(failing)} failed, see above; this run will fail", flush=True)
    return ["bash", "-c", 'trap : INT; "$@"; code=$?; exit $((code ? code : 1))', "pytest", *pytest]
