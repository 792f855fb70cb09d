# SPDX-License-Identifier: Apache-2.0
"""Packages laid out where there is no ROS: what colcon would have installed, without building."""

import os
import re
from pathlib import Path

import pytest

from bootstrap import fingerprint
from bootstrap.environment import NONE
from bootstrap.layout import lay_out
from bootstrap.plan import Need, find_need
from bootstrap.project import Project, State
from bootstrap.requirements import blocks
from bootstrap.work import Work

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def work(tmp_path):
    (tmp_path / "src").symlink_to(ROOT / "src")
    project = Project(tmp_path, "Linux aarch64")
    project.venv.mkdir()
    return Work(project, NONE, {}, State())


def need(work):
    return Need(True, False, fingerprint.packages(work.project), ())


def below(folder: Path) -> set[str]:
    return {str(file.relative_to(folder)) for file in folder.rglob("*") if not file.is_dir()}


@pytest.mark.skipif("SUNPOINT_HOME" not in os.environ, reason="compares with what ./sunpoint has built")
def test_executables_and_marks_are_those_of_a_build(work):
    lay_out(work, need(work))
    for name in work.state.packages:
        built = ROOT / "install" / name
        wanted = {
            f for f in below(built) if re.match(r"lib/\w+/\w+$|share/ament_index/resource_index/(packages|sun)", f)
        }
        assert wanted <= below(work.project.install / name)
    assert len(work.state.packages) >= 12
    assert (work.project.install / "css_msgs/share/css_msgs/msg/SunEstimate.msg").is_file()
    assert (work.project.install / "css_msgs/share/std_msgs/msg/Header.msg").is_file()


def test_nothing_is_left_to_do_and_what_is_gone_is_forgotten(work):
    lay_out(work, need(work))
    work.state.install = fingerprint.installation(work.project, NONE)
    assert not find_need(work.project, NONE, work.state, with_tests=False)
    assert State.load(work.project.state_file).packages == work.state.packages
    lay_out(work, Need(False, False, {}, ("css_papers",)))
    assert not (work.project.install / "css_papers").exists()
    assert not list((work.project.install / "python").glob("css_papers*"))
    assert not any("css_papers" in path for path in work.state.environment.prepend["AMENT_PREFIX_PATH"])


def test_a_package_is_laid_out_again_over_what_was_there(work):
    for _ in range(2):
        lay_out(work, need(work))
    python = work.project.install / "python"
    assert (python / "css_common").resolve() == (ROOT / "src/css_common/css_common").resolve()
    assert len(list(python.glob("css_common-*.dist-info"))) == 1


@pytest.mark.parametrize("machine", ["Linux aarch64", "Darwin arm64", "Darwin x86_64"])
def test_what_is_installed_without_ros_is_the_rest_in_the_same_releases(machine):
    whole = fingerprint.lock_file(Project(ROOT, machine), "wheels")
    file = fingerprint.lock_file(Project(ROOT, machine), NONE)
    releases = dict(re.findall(r"^([\w.-]+)==(\S+)", whole.read_text(), re.MULTILINE))
    here = dict(re.findall(r"^([\w.-]+)==(\S+)", file.read_text(), re.MULTILINE))
    assert not [name for name, _ in blocks(file.read_text()) if name.startswith(("ros-", "colcon-"))]
    assert {"numpy", "numba", "rosbags", "pyarrow"} <= here.keys()
    others = {name for name in here if releases.get(name) != here[name]}
    assert others == ({"numba", "llvmlite", "numpy"} if machine == "Darwin x86_64" else set())
