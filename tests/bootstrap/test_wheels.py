# SPDX-License-Identifier: Apache-2.0
"""Mending of the wheels' CMake files."""

import os

import pytest

from bootstrap.wheels import mend_cmake_files

EXPORT = """set_target_properties(std_msgs::gen_py PROPERTIES
  INTERFACE_INCLUDE_DIRECTORIES "${{_IMPORT_PREFIX}}/include;{python};{numpy}"
)
"""


@pytest.fixture
def share(tmp_path):
    """Two wheels, built with different Pythons, and files that are nobody's business."""
    for package, tag, version in (("std_msgs", "cp311-cp311", "3.11"), ("nav_msgs", "cp313-cp313", "3.13")):
        root = f"/opt/python/{tag}"
        text = EXPORT.format(
            python=f"{root}/include/python{version}",
            numpy=f"{root}/lib/python{version}/site-packages/numpy/_core/include",
        )
        folder = tmp_path / "share" / package / "cmake"
        folder.mkdir(parents=True)
        (folder / "export.cmake").write_text(text)
        (folder / "other.cmake").write_text("# nothing to mend\n")
    return tmp_path / "share"


def test_paths_become_those_of_this_machine(share):
    assert mend_cmake_files(share, "/usr/include/python3.12", "/venv/numpy/include") == 2
    expected = EXPORT.format(python="/usr/include/python3.12", numpy="/venv/numpy/include")
    for package in ("std_msgs", "nav_msgs"):
        assert (share / package / "cmake" / "export.cmake").read_text() == expected


def test_second_time_changes_nothing(share):
    mend_cmake_files(share, "/usr/include/python3.12", "/venv/numpy/include")
    before = {file: (file.read_bytes(), file.stat().st_mtime_ns) for file in share.rglob("*.cmake")}
    assert mend_cmake_files(share, "/other", "/other") == 0
    assert before == {file: (file.read_bytes(), file.stat().st_mtime_ns) for file in share.rglob("*.cmake")}


def test_cached_copy_of_a_package_stays_as_published(share, tmp_path):
    file = share / "std_msgs" / "cmake" / "export.cmake"
    cached = tmp_path / "cached.cmake"
    os.link(file, cached)
    published = cached.read_text()
    mend_cmake_files(share, "/usr/include/python3.12", "/venv/numpy/include")
    assert cached.read_text() == published != file.read_text()


def test_backslashes_in_paths_are_taken_literally(share):
    mend_cmake_files(share, r"/odd\1name", "/n")
    assert r"/odd\1name" in (share / "std_msgs" / "cmake" / "export.cmake").read_text()
