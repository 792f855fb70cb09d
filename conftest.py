# SPDX-License-Identifier: Apache-2.0
"""Keeps every pytest process, and the processes it starts, in a ROS domain of its own; settles hypothesis.

Two graphs in one domain answer each other's stamps. A run of pytest, each of its xdist workers, and runs of other
users on the same machine therefore hold a domain number each, by a lock that ends with the process. Loaded for all
tests of the project, with or without ROS, and before any of them imports rclpy.
"""

import atexit
import contextlib
import fcntl
import os
import shutil
import signal
import tempfile
from pathlib import Path

from hypothesis import settings

# Above 101 the ports of a domain reach into those that Linux hands to outgoing connections.
DOMAINS = range(1, 102)


def _hold_domain() -> tuple[int, int]:
    """A domain number that no other test process has, and the open file whose lock keeps it so."""
    folder = Path("/tmp/sunpoint-test-domains")
    with contextlib.suppress(FileExistsError):
        folder.mkdir()
        folder.chmod(0o777)  # other users' tests take their domains from the same numbers
    first = os.getpid() % len(DOMAINS)  # spread out: a domain just given up may still have participants leaving it
    for domain in (*DOMAINS[first:], *DOMAINS[:first]):
        file = os.open(folder / str(domain), os.O_RDONLY | os.O_CREAT, 0o644)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(file)
        else:
            return domain, file
    raise RuntimeError(f"all ROS domains {DOMAINS[0]} to {DOMAINS[-1]} are held by test processes; see {folder}")


DOMAIN, _lock = _hold_domain()
_logs = tempfile.mkdtemp(prefix="sunpoint-test-logs-")
atexit.register(shutil.rmtree, _logs, ignore_errors=True)

os.environ["ROS_DOMAIN_ID"] = str(DOMAIN)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ["ROS_LOG_DIR"] = _logs
# Without it rclpy stores a value of the wrong type as garbage, without a word.
os.environ["ROS_PYTHON_CHECK_FIELDS"] = "1"

# Two runs of the same sources try the same examples. `--hypothesis-profile=explore` looks for new ones.
# No deadlines: the first call of a kernel compiles it, and wall time is no property of the code under test.
settings.register_profile("sunpoint", deadline=None, derandomize=True)
settings.register_profile("explore", deadline=None, max_examples=2000)
settings.load_profile("sunpoint")


if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A runner in the background ignores the interrupt, and so would every process that a test starts and interrupts.
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_report_header() -> str:
    """Names the domain, for a look at a test that hangs: `ROS_DOMAIN_ID=N ros2 node list`."""
    return f"ROS_DOMAIN_ID: {DOMAIN}"
