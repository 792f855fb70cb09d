# SPDX-License-Identifier: Apache-2.0
"""Which flight `shell`, `record` and `play` join, and what they say about it."""

import os
from typing import Any

import pytest

from bootstrap import cli, joining
from bootstrap.joining import Wish, split_wish
from bootstrap.project import Refusal
from css_common.domains import JOINED, Holder, own
from css_common.network import NetworkError

TUMBLE = Holder(17, 400, "flight", "tumble", "2026-01-01T00:00:00+00:00", "/bags/tumble_0")
SPIN = Holder(23, 500, "flight", "spin", "2026-01-01T00:00:00+00:00")
STRANGER = Holder(31, 600, "", "python3 fly")


def join(environ, wish, must_choose=True):
    return joining.join(environ, wish, must_choose=must_choose)


@pytest.fixture
def running(monkeypatch):
    """Lets flights run."""

    def run(*flights):
        monkeypatch.setattr(joining, "flights", lambda: list(flights))

    run()
    return run


def test_without_a_flight_ros_decides(running):
    assert join({}, Wish()) == ({}, "ROS domain 0: no flight is running")


def test_the_only_flight_is_joined(running):
    running(TUMBLE)
    env, said = join({"HOME": "/me"}, Wish())
    assert env == {"HOME": "/me", "ROS_DOMAIN_ID": "17", JOINED: "17"}
    assert said == (
        "ROS domain 17: joining flight tumble (pid 400, since 2026-01-01T00:00:00+00:00, recording /bags/tumble_0)"
    )


def test_the_users_domain_wins(running):
    running(TUMBLE)
    assert join({"ROS_DOMAIN_ID": "5"}, Wish()) == ({"ROS_DOMAIN_ID": "5"}, "ROS domain 5: ROS_DOMAIN_ID")
    env, said = join({"ROS_DOMAIN_ID": "5"}, Wish(domain="6"))
    assert (env["ROS_DOMAIN_ID"], said) == ("6", "ROS domain 6: --domain")


@pytest.mark.parametrize("wanted", ["tumble", "400", "/bags/tumble_0", "tumble_0"])
def test_one_of_several_is_named(running, wanted):
    running(SPIN, TUMBLE, STRANGER)
    assert join({"ROS_DOMAIN_ID": "5"}, Wish(flight=wanted))[0]["ROS_DOMAIN_ID"] == "17"


def test_several_are_listed(running):
    running(SPIN, TUMBLE)
    with pytest.raises(Refusal, match=r"2 flights are running, choose with --flight NAME\|PID or --d") as refusal:
        join({}, Wish())
    assert refusal.value.exit_code == 2
    assert refusal.value.remedy.splitlines() == [f"domain 23: {SPIN}", f"  domain 17: {TUMBLE}"]
    with pytest.raises(Refusal, match="no flight 'walk' is running") as refusal:
        join({}, Wish(flight="walk"))
    assert "domain 23" in refusal.value.remedy


def test_a_shell_opens_among_several_and_lists_them(running):
    running(SPIN, TUMBLE)
    env, said = join({"HOME": "/me"}, Wish(), must_choose=False)
    assert env == {"HOME": "/me"}
    assert said.splitlines() == [
        "ROS domain 0: 2 flights are running, choose with --flight NAME|PID or --domain N",
        f"  domain 23: {SPIN}",
        f"  domain 17: {TUMBLE}",
    ]


def test_another_users_flight_is_joined_by_name_alone(running):
    running(STRANGER)
    assert join({}, Wish()) == ({}, "ROS domain 0: no flight is running")
    env, said = join({}, Wish(flight="600"))
    assert (env["ROS_DOMAIN_ID"], said) == ("31", "ROS domain 31: joining process python3 fly (pid 600)")


def test_a_shell_stays_with_its_flight_and_finds_the_next(running):
    running(SPIN, TUMBLE)
    inside = {"ROS_DOMAIN_ID": "17", JOINED: "17"}
    assert join(inside, Wish())[0] == inside
    running(SPIN)
    assert join(inside, Wish())[0]["ROS_DOMAIN_ID"] == "23"
    running()
    assert join(inside, Wish()) == ({}, "ROS domain 0: no flight is running")


@pytest.mark.parametrize(
    ("line", "before_words", "wish", "rest"),
    [
        ("--flight tumble -c --domain", True, Wish("tumble"), "-c --domain"),
        ("-l --domain=5 script --domain 6", True, Wish(None, "5"), "-l script --domain 6"),
        ("bag --domain 5 --loop", False, Wish(None, "5"), "bag --loop"),
        ("--ros-args --domain 5", False, Wish(), "--ros-args --domain 5"),
    ],
)
def test_own_options_are_taken_out_of_the_command_line(line, before_words, wish, rest):
    assert split_wish(line.split(), before_words=before_words) == (wish, rest.split())


def test_an_option_without_its_value_is_refused():
    with pytest.raises(Refusal, match="--flight needs a value"):
        split_wish(["--flight"], before_words=True)


@pytest.mark.parametrize("environ", [{"ROS_DOMAIN_ID": "abc"}, {"ROS_DOMAIN_ID": ""}])
def test_what_is_no_domain_is_refused(running, environ):
    with pytest.raises(NetworkError, match="expected a whole number from 0 to 232"):
        join(environ, Wish())


def test_a_shell_joins_a_flight_by_name(monkeypatch, capfd):
    """From the command line to the environment of the command, with a domain that is really held."""
    entered: dict[Any, Any] = {}
    monkeypatch.setattr(cli, "_replace_process", lambda command, env: entered.update(env, command=command) or 0)
    monkeypatch.setattr(cli, "find_need", lambda *_: False)
    monkeypatch.delenv("ROS_DOMAIN_ID")
    with own({}, "a_flight_of_this_test") as held:
        assert cli.main(["shell", "--flight", "a_flight_of_this_test", "-c", "true"]) == 0
        assert entered["ROS_DOMAIN_ID"] == str(held.domain)
    assert entered["command"] == ["bash", "-c", "true"]
    said = f"sunpoint: ROS domain {held.domain}: joining flight a_flight_of_this_test (pid {os.getpid()}"
    assert capfd.readouterr().err.startswith(said)
