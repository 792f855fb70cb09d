# SPDX-License-Identifier: Apache-2.0
"""Which changes ask for an installation or a build, and which must not."""

import pytest

from bootstrap import fingerprint
from bootstrap.plan import find_need
from bootstrap.project import Environment, Project, State


@pytest.fixture
def project(tmp_path):
    """A project with a node package and a message package."""
    files = {
        "requirements-uv.lock": "uv==1",
        "requirements.lock": "numpy==1",
        "requirements-test.lock": "pytest==1",
        "src/nodes_pkg/package.xml": "<package/>",
        "src/nodes_pkg/setup.py": "setup()",
        "src/nodes_pkg/nodes_pkg/nodes/first.py": "def main(): ...",
        "src/nodes_pkg/nodes_pkg/algorithm.py": "x = 1",
        "src/nodes_pkg/test/test_it.py": "",
        "src/msgs_pkg/package.xml": "<package/>",
        "src/msgs_pkg/CMakeLists.txt": "",
        "src/msgs_pkg/msg/Sun.msg": "float64 x",
        "src/notes/README.md": "not a package",
    }
    for name, text in files.items():
        write(tmp_path / name, text)
    return Project(tmp_path)


def write(file, text):
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text)


def settled(project):
    """The state after everything has been installed and built."""
    packages = fingerprint.packages(project)
    for name in packages:
        (project.install / name).mkdir(parents=True, exist_ok=True)
    return State(
        fingerprint.installation(project, "wheels"), fingerprint.test_requirements(project), packages, Environment()
    )


def test_nothing_to_do_when_nothing_changed(project):
    assert not find_need(project, "wheels", settled(project), with_tests=True)


@pytest.mark.parametrize(
    "name",
    [
        "src/nodes_pkg/nodes_pkg/algorithm.py",
        "src/nodes_pkg/nodes_pkg/nodes/first.py",
        "src/nodes_pkg/nodes_pkg/new_algorithm.py",
        "src/nodes_pkg/nodes_pkg/nodes/__pycache__/first.cpython-311.pyc",
        "src/nodes_pkg/test/test_more.py",
        "src/notes/README.md",
    ],
)
def test_python_edits_need_no_build(project, name):
    state = settled(project)
    write(project.root / name, "y = 2")
    assert not find_need(project, "wheels", state, with_tests=True)


@pytest.mark.parametrize(
    ("name", "package"),
    [
        ("src/nodes_pkg/package.xml", "nodes_pkg"),
        ("src/nodes_pkg/setup.py", "nodes_pkg"),
        ("src/nodes_pkg/setup.cfg", "nodes_pkg"),
        ("src/nodes_pkg/nodes_pkg/nodes/second.py", "nodes_pkg"),
        ("src/nodes_pkg/nodes_pkg/commands/tool.py", "nodes_pkg"),
        ("src/nodes_pkg/launch/fly.launch.py", "nodes_pkg"),
        ("src/msgs_pkg/CMakeLists.txt", "msgs_pkg"),
        ("src/msgs_pkg/msg/Sun.msg", "msgs_pkg"),
        ("src/msgs_pkg/srv/Ask.srv", "msgs_pkg"),
    ],
)
def test_changed_build_inputs_rebuild_their_package_only(project, name, package):
    state = settled(project)
    write(project.root / name, "changed")
    need = find_need(project, "wheels", state, with_tests=True)
    assert (need.install, need.tests, set(need.packages), need.removed) == (False, False, {package}, ())


def test_removed_node_rebuilds(project):
    state = settled(project)
    (project.source / "nodes_pkg/nodes_pkg/nodes/first.py").unlink()
    assert set(find_need(project, "wheels", state, with_tests=False).packages) == {"nodes_pkg"}


def test_removed_package_is_forgotten(project):
    state = settled(project)
    (project.source / "msgs_pkg/package.xml").unlink()
    need = find_need(project, "wheels", state, with_tests=False)
    assert (need.packages, need.removed) == ({}, ("msgs_pkg",))


def test_deleted_install_folder_is_built_again(project):
    state = settled(project)
    (project.install / "nodes_pkg").rmdir()
    assert set(find_need(project, "wheels", state, with_tests=False).packages) == {"nodes_pkg"}


def test_lock_file_ros_and_folder_ask_for_installation(project, tmp_path):
    state = settled(project)
    assert find_need(project, "system", state, with_tests=False).install
    (tmp_path / "requirements.lock").write_text("numpy==2")
    need = find_need(project, "wheels", state, with_tests=False)
    assert need.install
    assert set(need.packages) == {"nodes_pkg", "msgs_pkg"}, "scripts and libraries of the old environment"
    moved = tmp_path / "elsewhere"
    moved.mkdir()
    for lock in ("requirements-uv.lock", "requirements.lock"):
        write(moved / lock, (tmp_path / lock).read_text())
    key = fingerprint.installation(project, "wheels")
    assert fingerprint.installation(Project(moved), "wheels") != key


def test_test_tools_are_installed_for_tests_only(project, tmp_path):
    state = settled(project)
    (tmp_path / "requirements-test.lock").write_text("pytest==2")
    assert not find_need(project, "wheels", state, with_tests=False)
    assert find_need(project, "wheels", state, with_tests=True).tests


def test_parts_cannot_be_mistaken_for_each_other(tmp_path):
    one, two = tmp_path / "one", tmp_path / "two"
    write(one / "msg" / "A.msg", "bc")
    write(two / "msg" / "A.msgb", "c")
    assert fingerprint.package(one) != fingerprint.package(two)


def test_state_survives_a_round_trip_and_bad_files(tmp_path):
    file = tmp_path / "state.json"
    assert State.load(file) == State()
    state = State("i", "t", {"p": "1"}, Environment({"A": "1"}, {"PATH": ["/x"]}))
    state.save(file)
    assert State.load(file) == state
    assert [entry.name for entry in tmp_path.iterdir()] == ["state.json"]
    for text in ("", "{", "[]", '{"install": "i"}', '{"environment": {}, "unknown": 1}'):
        file.write_text(text)
        assert State.load(file) == State()


def test_an_extra_is_installed_for_those_alone_who_ask_for_it(project, tmp_path):
    write(tmp_path / "requirements-docs.lock", "sphinx==1")
    state = settled(project)
    assert not find_need(project, "wheels", state, True)
    assert find_need(project, "wheels", state, False, "docs").extra == "docs"
    state.extras["docs"] = fingerprint.extra_requirements(project, "docs")
    assert not find_need(project, "wheels", state, False, "docs")
    write(tmp_path / "requirements-docs.lock", "sphinx==2")
    assert find_need(project, "wheels", state, False, "docs").extra == "docs"
