# SPDX-License-Identifier: Apache-2.0
"""The composed environment, and the choice between ROS wheels and a sourced installation."""

import subprocess
import sys
from pathlib import Path

import pytest

from bootstrap.environment import (
    changes,
    compose,
    machine_of,
    ros_source,
    toolchain,
    without_foreign_python,
    without_other_sunpoint,
)
from bootstrap.project import Environment, Project, Refusal
from bootstrap.requirements import blocks, for_system

ROOT = Path(__file__).resolve().parents[2]
PC = "Linux x86_64"
SOURCED = {"ROS_DISTRO": "jazzy", "AMENT_PREFIX_PATH": "/opt/ros/jazzy"}


@pytest.mark.parametrize(
    ("machine", "without"),
    [(PC, "wheels"), ("Linux aarch64", "none"), ("Darwin arm64", "none"), ("Darwin x86_64", "none")],
)
def test_ros_source(machine, without):
    assert ros_source({}, machine) == without
    assert ros_source({"ROS_DISTRO": "jazzy"}, machine) == without
    assert ros_source({"AMENT_PREFIX_PATH": "/home/me/overlay"}, machine) == without
    assert ros_source(SOURCED, machine) == "system"


def test_the_machine_is_what_the_script_was_told_and_is_handed_on_to_nobody():
    assert machine_of({"SUNPOINT_MACHINE": "Darwin arm64"}) == "Darwin arm64"
    here = subprocess.check_output(["uname", "-sm"], text=True).strip()
    assert machine_of({}) == here
    assert without_other_sunpoint({"SUNPOINT_MACHINE": here, "A": "b"}) == {"A": "b"}


def test_without_ros_nothing_is_said_of_ros(tmp_path):
    environment = toolchain(Project(tmp_path), "none")
    assert set(environment.prepend) == {"PATH"}
    assert not any(name.startswith(("ROS", "AMENT", "_ROS")) for name in environment.assign)


def test_other_distributions_are_refused():
    with pytest.raises(Refusal, match="humble") as refusal:
        ros_source({"ROS_DISTRO": "humble", "AMENT_PREFIX_PATH": "/opt/ros/humble"}, PC)
    assert "jazzy" in refusal.value.remedy


def test_wheels_environment_needs_no_second_start_of_python(tmp_path):
    version = f"python{sys.version_info[0]}.{sys.version_info[1]}"
    bundled = tmp_path / ".venv" / "lib" / version / "site-packages" / "ros_rcl.libs"
    bundled.mkdir(parents=True)
    environment = toolchain(Project(tmp_path), "wheels")
    assert environment.assign["_ROS_WHEELS_BOOTSTRAP_COMPLETE"] == "1"
    assert environment.prepend["LD_LIBRARY_PATH"] == [f"{tmp_path}/.venv/lib", str(bundled)]
    assert environment.prepend["AMENT_PREFIX_PATH"] == [f"{tmp_path}/.venv"]


def test_system_environment_leaves_ros_as_sourced(tmp_path):
    environment = toolchain(Project(tmp_path), "system")
    assert set(environment.prepend) == {"PATH"}
    env = compose({**SOURCED, "PATH": "/opt/ros/jazzy/bin:/usr/bin"}, environment)
    assert env["AMENT_PREFIX_PATH"] == "/opt/ros/jazzy"
    assert env["PATH"] == f"{tmp_path}/.venv/bin:/opt/ros/jazzy/bin:/usr/bin"
    assert "_ROS_WHEELS_BOOTSTRAP_COMPLETE" not in env


def test_defaults_yield_to_the_user(tmp_path):
    tools = toolchain(Project(tmp_path), "wheels")
    assert compose({}, tools)["RMW_IMPLEMENTATION"] == "rmw_fastrtps_cpp"
    chosen = {"RMW_IMPLEMENTATION": "x", "MPLBACKEND": "svg"}
    env = compose({**chosen, "OMP_NUM_THREADS": "3"}, tools)
    assert {name: env[name] for name in chosen} == chosen
    assert env["OMP_NUM_THREADS"] == "3"
    assert env["SUNPOINT_HOME"] == str(tmp_path)
    assert env["ROS_LOG_DIR"].startswith(str(tmp_path))


def test_logs_of_another_users_checkout_are_the_users_own(tmp_path, monkeypatch):
    tools = toolchain(Project(tmp_path / "project"), "wheels")
    monkeypatch.setattr("css_common.places.may_write", lambda folder: not folder.is_relative_to(tmp_path / "project"))
    env = compose({"XDG_CACHE_HOME": str(tmp_path)}, tools)
    assert (env["ROS_HOME"], env["ROS_LOG_DIR"]) == (f"{tmp_path}/sunpoint/log", f"{tmp_path}/sunpoint/log/ros")


def test_python_folders_of_strangers_are_left_out():
    ros, overlay, strange = "/opt/ros/jazzy/lib/python3.12/site-packages", "/ws/build/mine", "/home/me/tools"
    env = {
        "PYTHONPATH": f"{strange}:{ros}::{overlay}:/opt/ros/jazzy2",
        "AMENT_PREFIX_PATH": "/ws/install/mine:/opt/ros/jazzy",
        "COLCON_PREFIX_PATH": "/ws/install/",
    }
    cleaned, left_out = without_foreign_python(env)
    assert cleaned == {**env, "PYTHONPATH": f"{ros}:{overlay}"}
    assert left_out == [strange, "/opt/ros/jazzy2"]
    assert without_foreign_python({"PYTHONPATH": strange}) == ({}, [strange])
    assert without_foreign_python({"A": "b"}) == ({"A": "b"}, [])


def test_composing_twice_adds_nothing(tmp_path):
    tools = toolchain(Project(tmp_path), "wheels")
    once = compose({"PATH": "/usr/bin", "PYTHONHOME": "/wrong"}, tools)
    assert "PYTHONHOME" not in once
    assert compose(once, tools) == once


@pytest.mark.parametrize("ros", ["wheels", "system"])
def test_an_enclosing_sunpoint_shell_leaves_no_trace(tmp_path, ros):
    user = {"PATH": "/usr/bin", "HOME": "/home/me", **(SOURCED if ros == "system" else {})}
    inside = compose(user, toolchain(Project(tmp_path / "other"), ros))
    cleaned = without_other_sunpoint(inside)
    assert not any(str(tmp_path) in value for value in cleaned.values())
    assert ros_source(cleaned, PC) == ros
    assert {name: cleaned[name] for name in user} == user


def test_changes_of_sourcing_become_entries_to_prepend():
    before = {"PATH": "/a:/b", "KEPT": "1", "PWD": "/x"}
    after = {"PATH": "/new:/a:/b", "KEPT": "1", "PWD": "/y", "PYTHONPATH": "/p:/q", "FLAG": "on"}
    assert changes(before, after) == Environment({"FLAG": "on"}, {"PATH": ["/new"], "PYTHONPATH": ["/p", "/q"]})
    assert (
        compose({**before, "SUNPOINT_HOME": "/"}, Environment({"SUNPOINT_HOME": "/"}, {"PATH": ["/new"]}))["PATH"]
        == "/new:/a:/b"
    )


def test_system_installation_brings_ros_and_numpy_itself():
    lock = (ROOT / "requirements.lock").read_text()
    names = {name for name, _ in blocks(lock)}
    assert {"numpy", "numba", "ros-rclpy", "colcon-core", "mcap"} <= names
    kept = {name for name, _ in blocks(for_system(lock, has_colcon=True))}
    assert {"numba", "mcap", "rosbags", "pyarrow"} <= kept
    assert not {name for name in kept if name.startswith(("ros-", "colcon-")) or name == "numpy"}
    assert names - {name for name, _ in blocks(for_system(lock, has_colcon=False))} <= {
        name for name in names if name.startswith("ros-")
    } | {"numpy", "empy", "lark-parser", "catkin-pkg"}


def test_filtered_lock_keeps_every_hash_of_what_remains():
    a = ["a==1 \\", "    --hash=sha256:1 \\", "    --hash=sha256:2"]
    ros = ["ros-b==1 \\", "    --hash=sha256:3"]
    c = ["c==2 ; x < '3' \\", "    --hash=sha256:4"]
    lock = "\n".join(["# a comment", *a, *ros, "# another", *c, ""])
    assert for_system(lock, has_colcon=True).splitlines() == [*a, *c]


def test_bytecode_is_kept_also_where_it_is_switched_off(tmp_path):
    env = compose({"SUNPOINT_HOME": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}, Environment())
    assert "PYTHONDONTWRITEBYTECODE" not in env
    assert env["PYTHONPYCACHEPREFIX"] == str(tmp_path / ".cache" / "bytecode")
