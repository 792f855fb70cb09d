# SPDX-License-Identifier: Apache-2.0
"""The verb `test`: ruff, mypy and pytest in the project's environment."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping

from bootstrap.project import Project


def run_checks(project: Project, arguments: list[str], env: Mapping[str, str]) -> int:
    """Run all checks, the tests last; returns pytest's exit code, or 1 when only ruff or mypy complain."""
    env = {**env, "ROS_PYTHON_CHECK_FIELDS": "1"}
    failed = []
    for tool in (["ruff", "check"], ["mypy"]):
        print(f"== {' '.join(tool)}", flush=True)
        if subprocess.call([project.python, "-m", *tool], env=env, cwd=project.root):
            failed.append(tool[0])
    verdict = f" ({' and '.join(failed)} failed above, so this run fails)" if failed else ""
    print(f"== pytest{verdict}", flush=True)
    code = subprocess.call([project.python, "-m", "pytest", *arguments], env=env, cwd=project.root)
    return code or int(bool(failed))
