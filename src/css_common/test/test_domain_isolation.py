# SPDX-License-Identifier: Apache-2.0
"""The project's conftest gives every test process a ROS domain of its own."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
PROGRAM = "import conftest, os, sys; print(os.environ['ROS_DOMAIN_ID'], flush=True); sys.stdin.read()"


def held_domain() -> tuple[int, subprocess.Popen]:
    """A process that holds a domain until its input ends."""
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    return int(process.stdout.readline()), process


def test_processes_at_the_same_time_have_different_domains():
    held = [held_domain() for _ in range(4)]
    domains = [domain for domain, _ in held] + [int(os.environ["ROS_DOMAIN_ID"])]
    for _, process in held:
        process.communicate()
    assert len(set(domains)) == len(domains)
    assert all(1 <= domain <= 101 for domain in domains)


def test_environment_of_the_tests():
    assert os.environ["ROS_PYTHON_CHECK_FIELDS"] == "1"
    assert os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    assert not Path(os.environ["ROS_LOG_DIR"]).is_relative_to(ROOT)
