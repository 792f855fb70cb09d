# SPDX-License-Identifier: Apache-2.0
"""What `./sunpoint --version` prints."""

from __future__ import annotations

import re
import subprocess

from bootstrap.project import Project


def version_text(project: Project) -> str:
    """Version of the packages, and the commit of the checkout when it is one and git is there."""
    manifest = (project.source / "css_bringup" / "package.xml").read_text(encoding="utf-8")
    version = re.search(r"<version>(.*)</version>", manifest)
    commit = _commit(project)
    return f"sunpoint {version[1] if version else 'of no version'}{f' ({commit})' if commit else ''}"


def _commit(project: Project) -> str:
    if not (project.root / ".git").exists():
        return ""
    # git refuses to read another user's checkout unless it is named
    git = ["git", "-C", str(project.root), "-c", f"safe.directory={project.root}"]
    describe = ["describe", "--always", "--dirty", "--exclude=*"]
    try:
        done = subprocess.run([*git, *describe], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return ""
    return done.stdout.strip()
