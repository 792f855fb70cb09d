# SPDX-License-Identifier: Apache-2.0
"""Brings the environment and the built packages up to date, one start at a time."""

from __future__ import annotations

import contextlib
import errno
import fcntl
from collections.abc import Iterator, Mapping

from bootstrap.build import build
from bootstrap.install import install, install_tests
from bootstrap.plan import find_need
from bootstrap.progress import say, stoppable
from bootstrap.project import Project, Refusal, State
from bootstrap.work import Work


def prepare(project: Project, ros: str, base: Mapping[str, str], with_tests: bool) -> State:
    """Install and build what is missing or changed; returns the state of the workspace afterwards.

    Raises Refusal with a message for the user when that is not possible.
    """
    try:
        project.logs.mkdir(parents=True, exist_ok=True)
        with stoppable(), _alone(project):
            # Whoever held the lock before may have done everything already.
            state = State.load(project.state_file)
            need = find_need(project, ros, state, with_tests)
            work = Work(project, ros, base, state)
            if need.install:
                install(work)
            if need.tests:
                install_tests(work)
            if need.packages or need.removed:
                build(work, need)
            return state
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise Refusal(f"no space left on the disk of {project.root}", "free 2 GB, then run it again") from None
        if error.errno in (errno.EACCES, errno.EROFS):
            raise Refusal(f"cannot write {error.filename}", "use a folder of your own, without sudo") from None
        raise


@contextlib.contextmanager
def _alone(project: Project) -> Iterator[None]:
    """Hold the project's installation lock; the system releases it however this process ends."""
    with (project.logs / "lock").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            say("sunpoint: another start is installing or building, waiting for it")
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield
