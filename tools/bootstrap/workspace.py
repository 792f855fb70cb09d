# SPDX-License-Identifier: Apache-2.0
"""Brings the environment and the built packages up to date, one start at a time."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
from collections.abc import Iterator, Mapping

from bootstrap.build import build
from bootstrap.environment import NONE
from bootstrap.install import install, install_extra, install_tests
from bootstrap.layout import lay_out
from bootstrap.plan import find_need
from bootstrap.progress import say, stoppable
from bootstrap.project import Project, Refusal, State
from bootstrap.work import Work, disk_full


def prepare(project: Project, ros: str, base: Mapping[str, str], with_tests: bool, extra: str = "") -> State:
    """Install and build what is missing or changed; returns the state of the workspace afterwards.

    Raises Refusal with a message for the user when that is not possible.
    """
    try:
        project.logs.mkdir(parents=True, exist_ok=True)
        with stoppable(), _alone(project):
            # Whoever held the lock before may have done everything already.
            state = State.load(project.state_file)
            need = find_need(project, ros, state, with_tests, extra)
            work = Work(project, ros, base, state)
            if need.install:
                install(work)
            if need.tests:
                install_tests(work)
            if need.extra:
                install_extra(work, need.extra)
            if need.packages or need.removed:
                (lay_out if ros == NONE else build)(work, need)
            return state
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise disk_full(project) from None
        if error.errno in (errno.EACCES, errno.EROFS):
            raise Refusal(
                f"cannot write {error.filename}, where Sunpoint is to be installed and built",
                "copy the project into a folder of your own, or let its owner run ./sunpoint shell -c true once",
            ) from None
        raise


@contextlib.contextmanager
def _alone(project: Project) -> Iterator[None]:
    """Hold the project's installation lock, which lasts as long as this process and its commands."""
    with (project.logs / "lock").open("w") as lock:
        os.set_inheritable(lock.fileno(), True)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            say("sunpoint: another start is installing or building, waiting for it")
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield
