# SPDX-License-Identifier: Apache-2.0
"""ROS stays on this machine unless it is asked to leave it in our own words."""

import os
import subprocess
from pathlib import Path

import pytest
from ament_index_python.packages import get_package_prefix

from css_common.network import NetworkError, stay_on_this_machine
from css_common.testing import Bench

RANGE, PEERS = "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS"


@pytest.mark.parametrize("found", ["SUBNET", "SYSTEM_DEFAULT", "nonsense"])
def test_a_wider_range_is_overridden_and_named(found):
    environ = {RANGE: found, PEERS: "192.0.2.7"}
    note = stay_on_this_machine(environ)
    assert environ == {RANGE: "LOCALHOST"}
    assert note == (
        f"{RANGE}={found} and {PEERS}=192.0.2.7 ignored, staying on this machine; SUNPOINT_NETWORK=subnet opens it"
    )
    assert stay_on_this_machine(environ) == ""


def test_what_is_narrow_already_is_left():
    for found, left in (({}, "LOCALHOST"), ({RANGE: "LOCALHOST"}, "LOCALHOST"), ({RANGE: "OFF"}, "OFF")):
        assert stay_on_this_machine(found) == ""
        assert found == {RANGE: left}


@pytest.mark.parametrize(("found", "left"), [("", "SUBNET"), ("LOCALHOST", "SUBNET"), ("SYSTEM_DEFAULT",) * 2])
def test_our_own_words_open_it(found, left):
    environ = {"SUNPOINT_NETWORK": "subnet", RANGE: found, PEERS: "192.0.2.7"}
    assert stay_on_this_machine(environ) == ""
    assert (environ[RANGE], environ[PEERS]) == (left, "192.0.2.7")


def test_other_words_are_refused():
    with pytest.raises(NetworkError, match="SUNPOINT_NETWORK: 'SUBNET' given, expected localhost or subnet"):
        stay_on_this_machine({"SUNPOINT_NETWORK": "SUBNET"})


def run(arguments: list[str], **environment: str) -> tuple[int, str]:
    """Exit code and error output of the recorder, as `ros2 run` starts it."""
    recorder = Path(get_package_prefix("css_recording"), "lib", "css_recording", "recorder")
    done = subprocess.run(
        [recorder, *arguments], env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )
    return done.returncode, done.stderr


def test_executables_enforce_it_by_themselves():
    code, err = run(["--help"], ROS_AUTOMATIC_DISCOVERY_RANGE="SUBNET")
    assert code == 0
    assert err.startswith(f"recorder: {RANGE}=SUBNET ignored, staying on this machine")
    code, err = run(["--help"], SUNPOINT_NETWORK="world")
    assert (code, err) == (2, "recorder: SUNPOINT_NETWORK: 'world' given, expected localhost or subnet\n")


def test_executables_refuse_a_domain_that_is_none_in_one_line(tmp_path):
    code, err = run(["-o", str(tmp_path / "bag")], ROS_DOMAIN_ID="abc")
    assert (code, err) == (2, "recorder: ROS_DOMAIN_ID: 'abc' given, expected a whole number from 0 to 232\n")
    assert not (tmp_path / "bag").exists()


def test_discovery_opens_no_multicast_port():
    """What the README says of the sockets of a node."""
    first = 7400 + 250 * int(os.environ["ROS_DOMAIN_ID"])
    with Bench():
        rows = [line.split()[1].split(":") for line in Path("/proc/net/udp").read_text().splitlines()[1:]]
    bound = {int(port, 16): address for address, port in rows if first <= int(port, 16) < first + 250}
    assert first not in bound
    assert set(bound.values()) == {"00000000"}
