# SPDX-License-Identifier: Apache-2.0
"""Compares what is installed and built with what should be. Runs at every start, so it stays cheap."""

from __future__ import annotations

from typing import NamedTuple

from bootstrap import fingerprint
from bootstrap.project import Project, State


class Need(NamedTuple):
    """What a start finds missing or changed; falsy when nothing is."""

    install: bool
    tests: bool
    packages: dict[str, str]
    removed: tuple[str, ...]
    extra: str = ""

    def __bool__(self) -> bool:
        return any(self)


def find_need(project: Project, ros: str, state: State, with_tests: bool, extra: str = "") -> Need:
    """What has to be done before a verb can run; `packages` maps what to build to its new fingerprint."""
    install = state.install != fingerprint.installation(project, ros)
    wanted = fingerprint.packages(project)
    built = {} if install else state.packages
    return Need(
        install=install,
        tests=with_tests and (install or state.test != fingerprint.test_requirements(project)),
        packages={
            name: value
            for name, value in wanted.items()
            if built.get(name) != value or not (project.install / name).is_dir()
        },
        removed=tuple(sorted(built.keys() - wanted.keys())),
        extra=extra if extra and (install or _is_new(project, state, extra)) else "",
    )


def _is_new(project: Project, state: State, extra: str) -> bool:
    return state.extras.get(extra) != fingerprint.extra_requirements(project, extra)
