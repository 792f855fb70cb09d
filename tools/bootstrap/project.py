# SPDX-License-Identifier: Apache-2.0
"""Where things lie in the project folder, and what is remembered between starts."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass, field
from pathlib import Path


class Refusal(Exception):
    """Something is missing or wrong on this machine; `remedy` is the command or step that mends it.

    `exit_code` is 1, or 2 for what the user got wrong.
    """

    def __init__(self, problem: str, remedy: str = "", exit_code: int = 1) -> None:
        super().__init__(problem)
        self.remedy = remedy
        self.exit_code = exit_code


@dataclass(frozen=True)
class Project:
    """The folders of one checkout, and the machine that it is used on as `uname -sm` names it."""

    root: Path
    machine: str = "Linux x86_64"

    @property
    def venv(self) -> Path:
        return self.root / ".venv"

    @property
    def python(self) -> Path:
        return self.venv / "bin" / "python"

    @property
    def source(self) -> Path:
        return self.root / "src"

    @property
    def build(self) -> Path:
        return self.root / "build"

    @property
    def install(self) -> Path:
        return self.root / "install"

    def extra(self, name: str) -> Path:
        """Where the packages of requirements-NAME.lock lie, apart from everything else."""
        return self.venv / "extra" / name

    @property
    def logs(self) -> Path:
        return self.root / "log" / "bootstrap"

    @property
    def state_file(self) -> Path:
        # Inside the environment it describes: removing .venv forgets everything at once.
        return self.venv / "sunpoint.json"

    def executable(self, package: str, name: str) -> Path:
        """The file that `ros2 run PACKAGE NAME` starts."""
        return self.install / package / "lib" / package / name


@dataclass
class Environment:
    """Changes to make to a user's environment: `assign` replaces, `prepend` goes before what is there."""

    assign: dict[str, str] = field(default_factory=dict)
    prepend: dict[str, list[str]] = field(default_factory=dict)


@dataclass
class State:
    """What is installed and built. Empty strings and missing packages mean: to be done."""

    install: str = ""
    test: str = ""
    packages: dict[str, str] = field(default_factory=dict)
    environment: Environment = field(default_factory=Environment)
    extras: dict[str, str] = field(default_factory=dict)

    @classmethod
    def load(cls, file: Path) -> State:
        """Read what `save` wrote; anything unreadable counts as nothing installed."""
        try:
            stored = json.loads(file.read_text())
            return cls(**{**stored, "environment": Environment(**stored["environment"])})
        except (OSError, ValueError, TypeError, KeyError):
            return cls()

    def save(self, file: Path) -> None:
        """Write in one step, so that a start next door reads the old or the new content, never half of it."""
        draft = file.with_name(f"{file.name}.{os.getpid()}")
        draft.write_text(json.dumps(asdict(self), indent=1))
        draft.replace(file)
