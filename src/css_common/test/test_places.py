# SPDX-License-Identifier: Apache-2.0
"""Files go into the project, and to places of the user's own where the project is another's."""

import os
import stat
import tempfile
from pathlib import Path

import pytest

from css_common import places


@pytest.fixture
def another_users(monkeypatch, tmp_path):
    """A project folder that nobody here may write, whoever runs the test."""
    project = tmp_path / "project"
    (project / "bags").mkdir(parents=True)
    monkeypatch.setenv("SUNPOINT_HOME", str(project))

    def access(path, mode, **_):
        return not Path(path).is_relative_to(project)

    monkeypatch.setattr(os, "access", access)
    return project


def test_everything_goes_into_the_project(monkeypatch, tmp_path):
    monkeypatch.setenv("SUNPOINT_HOME", str(tmp_path))
    assert places.results("bags") == tmp_path / "bags"
    assert places.scratch("kernels") == tmp_path / ".cache" / "kernels"
    assert places.logs() == tmp_path / "log"


def test_without_a_project_results_go_to_the_current_folder(monkeypatch, tmp_path):
    monkeypatch.delenv("SUNPOINT_HOME")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert places.results("bags") == Path("bags")
    assert places.scratch("kernels") == tmp_path / "sunpoint" / "kernels"


def test_another_users_project_is_left_alone(another_users, monkeypatch, tmp_path):
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    assert places.results("bags") == Path("bags")
    assert places.scratch("kernels") == tmp_path / ".cache" / "sunpoint" / "kernels"
    assert places.logs() == tmp_path / ".cache" / "sunpoint" / "log"


def test_a_user_without_any_folder_gets_one_that_no_other_can_write(another_users, monkeypatch, tmp_path):
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("HOME", str(another_users))
    monkeypatch.setattr(tempfile, "gettempdir", lambda: str(tmp_path))
    own = tmp_path / f"sunpoint-{os.getuid()}"
    assert places.scratch("kernels") == own / "kernels"
    assert stat.S_IMODE(own.stat().st_mode) == 0o700
    own.chmod(0o777)
    with pytest.raises(PermissionError, match="is writable by others"):
        places.scratch("kernels")


def test_a_file_is_no_folder_to_write_into(tmp_path):
    (tmp_path / "file").touch()
    assert places.may_write(tmp_path / "new" / "newer")
    assert not places.may_write(tmp_path / "file" / "below")
