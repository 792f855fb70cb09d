# SPDX-License-Identifier: Apache-2.0
"""Domains are held by one process each, told to others, and free again when their holder is gone."""

import json
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from presence import present

from css_common import domains
from css_common.domains import FLIGHT, JOINED, TEST, DomainError, Holder, flights, hold_free, holder_of, own
from css_common.network import NetworkError

ROOT = Path(__file__).resolve().parents[3]
HERE = {name: os.environ[name] for name in ("ROS_DOMAIN_ID", "SUNPOINT_DOMAIN_HOLDER")}
TESTS = "import conftest, os; print(os.environ['ROS_DOMAIN_ID'], flush=True); input()"
IMPORTS = "import os\nfrom css_common.domains import holder_of, own\n"
AS_ANOTHER_USER = "os.setgid(65534)\nos.setuid(65534)\n"
HOLDS = "held = own({}, 'tumble', recording='/bags/x')\nprint(held.domain, flush=True)\ninput()\n"
FLIES = IMPORTS + HOLDS


class Other:
    """Another process with a domain, until its input ends."""

    def __init__(self, program: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", program], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.domain = int(present(self.process.stdout).readline())

    def end(self) -> None:
        self.process.communicate()


@pytest.fixture
def start():
    """Starts processes with a domain and ends them."""
    started = []

    def start(program: str) -> Other:
        started.append(Other(program))
        return started[-1]

    yield start
    for other in started:
        other.end()


def test_tests_and_flights_never_meet(start):
    held = [start(program) for program in (TESTS, TESTS, FLIES, FLIES)]
    numbers = [other.domain for other in held] + [int(HERE["ROS_DOMAIN_ID"])]
    assert len(set(numbers)) == len(numbers)
    assert all(1 <= number <= 101 for number in numbers)
    assert [present(holder_of(other.domain)).kind for other in held] == [TEST, TEST, FLIGHT, FLIGHT]
    running = {flight.domain for flight in flights()}
    assert running.isdisjoint(other.domain for other in held[:2])
    assert running.issuperset(other.domain for other in held[2:])


def test_environment_of_the_tests():
    assert present(holder_of(int(HERE["ROS_DOMAIN_ID"]))).pid == os.getpid()
    assert os.environ["ROS_PYTHON_CHECK_FIELDS"] == "1"
    assert os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    assert not Path(os.environ["ROS_LOG_DIR"]).is_relative_to(ROOT)


def test_a_holder_tells_what_it_does(start):
    other = start(FLIES)
    holder = holder_of(other.domain)
    assert present(holder)[:4] == (other.domain, other.process.pid, FLIGHT, "tumble")
    assert present(holder).recording == "/bags/x"
    assert str(holder).startswith(f"flight tumble (pid {other.process.pid}, since 20")


def test_a_domain_that_is_held_is_refused_by_the_name_of_its_flight(start):
    other = start(FLIES)
    for environ, asked in (({}, str(other.domain)), ({"ROS_DOMAIN_ID": str(other.domain)}, None)):
        with pytest.raises(DomainError) as refused:
            own(environ, "mine", asked=asked)
        assert f"ROS domain {other.domain} is held by flight tumble (pid {other.process.pid}" in str(refused.value)
        assert "\n" not in str(refused.value)


def test_a_killed_holder_leaves_nothing(start):
    other = start(FLIES)
    other.process.send_signal(signal.SIGKILL)
    other.process.wait()
    assert holder_of(other.domain) is None
    with own({}, "mine", asked=str(other.domain)) as held:
        assert present(holder_of(held.domain)).pid == os.getpid()
    assert holder_of(held.domain) is None


def test_a_child_of_a_holder_does_not_keep_the_domain():
    held = own({}, "mine")
    with subprocess.Popen(["sleep", "60"], close_fds=False) as child:
        held.release()
        assert holder_of(held.domain) is None
        child.kill()


def test_a_flight_of_a_test_flies_in_the_domain_of_the_test():
    with own(HERE, "mine") as held:
        assert held.domain == int(HERE["ROS_DOMAIN_ID"])
    assert present(holder_of(held.domain)).kind == TEST
    with pytest.raises(DomainError, match="is held by test"):
        own({**HERE, "SUNPOINT_DOMAIN_HOLDER": "1"}, "mine")


def test_the_domain_of_a_flight_that_a_shell_has_joined_is_no_choice_of_the_user(start):
    joined = str(start(FLIES).domain)
    with own({"ROS_DOMAIN_ID": joined, JOINED: joined}, "mine") as held:
        assert str(held.domain) != joined


@pytest.mark.parametrize("number", ["abc", "", "300", "-1", "1.5", "٣"])
def test_what_is_no_number_of_a_domain_is_refused(number):
    with pytest.raises(NetworkError, match=f"ROS_DOMAIN_ID: '{number}' given, expected a whole number from 0 to 232"):
        own({"ROS_DOMAIN_ID": number}, "mine")
    with pytest.raises(NetworkError, match="--domain: "):
        own({}, "mine", asked=number)


def test_a_domain_in_which_a_stranger_speaks_is_not_free(monkeypatch):
    monkeypatch.setattr(domains, "FREE_TO_CHOOSE", range(230, 232))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.bind(("", 7400 + 250 * 230 + 10))
        for _ in range(2):
            with hold_free(FLIGHT, "mine") as held:
                assert held.domain == 231
                with pytest.raises(DomainError, match="all ROS domains from 230 to 231 are in use on this machine"):
                    hold_free(FLIGHT, "second")


@pytest.mark.skipif(os.getuid() != 0, reason="only root can become another user")
def test_users_share_the_domains_of_a_machine(start, monkeypatch):
    other = start(IMPORTS + AS_ANOTHER_USER + HOLDS)
    monkeypatch.setattr(domains, "_notes", lambda pid: (_ for _ in ()).throw(PermissionError()))
    holder = holder_of(other.domain)
    assert (present(holder).pid, present(holder).kind) == (other.process.pid, "")
    assert present(holder).name.startswith(sys.executable)
    with pytest.raises(DomainError, match=f"is held by process .*pid {other.process.pid}"):
        own({}, "mine", asked=str(other.domain))
    mine = own({}, "mine")
    asks = IMPORTS + AS_ANOTHER_USER + f"print(holder_of({mine.domain}).pid, holder_of({mine.domain}).kind)"
    done = subprocess.run([sys.executable, "-c", asks], capture_output=True, text=True, check=False)
    mine.release()
    assert done.stdout == f"{os.getpid()} \n", done.stderr


def test_notes_are_json_that_anybody_can_read(start):
    other = start(FLIES)
    (note,) = domains._notes(other.process.pid)
    assert Holder(**json.loads(note)).recording == "/bags/x"
