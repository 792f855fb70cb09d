# SPDX-License-Identifier: Apache-2.0
"""A first start on a machine without ROS wheels, from an empty checkout: what is installed, what runs, what is refused.

The machine is this one, with a `uname` on PATH that says otherwise.
"""

import json
import os
import shutil
import subprocess

import pytest
from listing import ROOT

# installs packages, and compiles kernels anew
pytestmark = pytest.mark.timeout(1000)

MADE = shutil.ignore_patterns(
    ".*cache*", ".git", ".venv", ".hypothesis", "build", "install", "log", "studies", "reports", "bags", "__pycache__"
)


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """A copy of the sources alone."""
    return shutil.copytree(ROOT, tmp_path_factory.mktemp("elsewhere") / "sunpoint", ignore=MADE)


@pytest.fixture(scope="module")
def start(checkout):
    """Run ./sunpoint of that checkout, on a machine of another kind."""
    uname = checkout.parent / "bin" / "uname"
    uname.parent.mkdir()
    uname.write_text('#!/bin/sh\necho "Linux aarch64"\n')
    uname.chmod(0o755)
    kept = ["HOME", "LANG", "XDG_CACHE_HOME", "SSL_CERT_FILE", "HTTPS_PROXY"]
    kept += [name for name in os.environ if name.startswith(("PIP_", "UV_"))]
    paths = [path for path in os.environ["PATH"].split(os.pathsep) if not path.startswith(str(ROOT))]
    env = {name: os.environ[name] for name in kept if name in os.environ}
    env["PATH"] = os.pathsep.join([str(uname.parent), *paths])

    def run(*arguments):
        command = [checkout / "sunpoint", *arguments]
        return subprocess.run(command, env=env, capture_output=True, text=True, timeout=900, check=False)

    return run


def test_a_flight_is_refused_in_one_line_and_nothing_is_installed_for_it(start, checkout):
    done = start("fly", "okeefe_2013")
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert "fly needs ROS 2 Jazzy" in line and "Linux aarch64" in line
    assert not (checkout / ".venv").exists()


def test_a_study_sets_up_what_it_needs_and_flies(start, checkout):
    # stepped node by node, which compiles a fifth of what the loop of a study takes
    study = ("--cases", "1", "--duration", "1", "--json")
    done = start("monte-carlo", "esprit_2006", *study, "--out", str(checkout / "study"))
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout.splitlines()[-1])["cases"] == 1
    assert (checkout / "study" / "cases.parquet").is_file()
    packages = {path.name for path in (checkout / ".venv").glob("lib/python*/site-packages/*")}
    assert "numba" in packages
    assert not [name for name in packages if name.startswith(("rclpy", "rosidl", "ros_", "ament", "colcon", "css_"))]
    assert not (checkout / "build").exists() or not list((checkout / "build").glob("*/"))


def test_the_next_start_has_nothing_to_do(start):
    done = start("shell", "-c", "python -c 'import css_msgs.msg as m; print(m.SunEstimate.__base__.__name__)'")
    assert (done.returncode, done.stdout) == (0, "MessageClass\n")
    assert "setting up" not in done.stderr and "laying out" not in done.stderr
