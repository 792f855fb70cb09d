# SPDX-License-Identifier: Apache-2.0
"""Security is enforced or refused, never left out in silence."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from css_common import security

COMPLAINTS = {
    "rmw_fastrtps": "This Fast DDS version doesn't have the security libraries\nPlease compile Fast DDS using the "
    "-DSECURITY=ON CMake option",
    "rmw_cyclonedds": "Security was requested but the Cyclone DDS being used does not have security support enabled",
}


def keystore(folder: Path, *enclaves: str) -> Path:
    for enclave in enclaves:
        place = folder / "enclaves" / enclave.strip("/")
        place.mkdir(parents=True)
        for name in ("identity_ca.cert.pem", "cert.pem", "key.pem", "permissions_ca.cert.pem"):
            (place / name).touch()
        for name in ("governance.p7s", "permissions.p7s"):
            (place / name).touch()
    return folder


def test_a_keystore_is_enforced_for_all_that_starts_inside_and_for_nothing_after(tmp_path):
    environ = {"ROS_SECURITY_STRATEGY": "Permissive", "HOME": "/"}
    store = keystore(tmp_path, "/sunpoint")
    with security.enforced(environ, store, ["/sunpoint"]):
        assert environ == {
            "HOME": "/", "ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": "Enforce",
            "ROS_SECURITY_KEYSTORE": str(store), "ROS_SECURITY_ENCLAVE_OVERRIDE": "/sunpoint",
        }  # fmt: skip
        assert security.of_process(environ, "ekf") == {"ROS_SECURITY_ENCLAVE_OVERRIDE": "/sunpoint/ekf"}
    assert environ == {"ROS_SECURITY_STRATEGY": "Permissive", "HOME": "/"}
    assert security.of_process(environ, "ekf") == {}


def test_enclaves_that_somebody_chose_stay():
    environ = {"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_ENCLAVE_OVERRIDE": "/mine"}
    with security.enforced(environ, None, ["/sunpoint"]):
        assert security.of_process(environ, "ekf") == {}
        assert environ["ROS_SECURITY_ENCLAVE_OVERRIDE"] == "/mine"


def test_each_process_has_an_enclave_of_its_own():
    assert security.enclaves_of(["ekf", "recorder"], processes=True) == ["/sunpoint/ekf", "/sunpoint/recorder"]
    assert security.enclaves_of(["ekf", "recorder"], processes=False) == ["/sunpoint"]


@pytest.mark.parametrize(
    ("made", "asked", "expected"),
    [
        ((), "/sunpoint", "no keystore, expected one of `ros2 security create_keystore`"),
        (("/sunpoint",), "/sunpoint/ekf", "no enclave /sunpoint/ekf, expected that of `ros2 security create_enclave "),
    ],
)
def test_what_a_keystore_lacks_is_refused_with_the_command_that_makes_it(tmp_path, made, asked, expected):
    with (
        pytest.raises(security.SecurityError) as error,
        security.enforced({}, keystore(tmp_path, *made), [asked]),
    ):
        pytest.fail("it is not enforced")
    assert expected in str(error.value) and "\n" not in str(error.value)


def test_a_file_that_is_missing_is_named(tmp_path):
    (keystore(tmp_path, "/sunpoint") / "enclaves" / "sunpoint" / "governance.p7s").unlink()
    with (
        pytest.raises(security.SecurityError, match=r"no governance\.p7s in the enclave /sunpoint"),
        security.enforced({}, tmp_path, ["/sunpoint"]),
    ):
        pytest.fail("it is not enforced")


def test_the_complaints_of_middlewares_are_understood():
    assert all(security.lacks_security(text) for text in COMPLAINTS.values())
    assert not security.lacks_security("SECURITY ERROR: unable to find a folder matching the enclave")


def test_nothing_is_tried_where_nothing_is_asked_for(monkeypatch):
    monkeypatch.setattr(security.subprocess, "run", lambda *_, **__: pytest.fail("tried"))
    for environ in ({}, {"ROS_SECURITY_ENABLE": "false"}, {"ROS_SECURITY_ENABLE": "TRUE"}):
        security.check(environ)
    security.check({"ROS_SECURITY_ENABLE": "true", "SUNPOINT_SECURITY_TRIED": "1"})


def has_security() -> bool:
    try:
        security.check({**os.environ, "ROS_SECURITY_ENABLE": "true"})
    except security.SecurityError:
        return False
    return True


@pytest.mark.skipif(has_security(), reason="this middleware has security")
@pytest.mark.parametrize("strategy", ["Permissive", "Enforce"])
def test_a_node_does_not_start_as_if_it_were_secure(strategy):
    environ = {**os.environ, "ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": strategy}
    command = "import sys; sys.argv = ['lib/css_sim/gyro']; from css_common.entry import main; sys.exit(main())"
    started = subprocess.run([sys.executable, "-c", command], env=environ, capture_output=True, text=True, check=False)
    assert started.returncode == 2
    assert "is built without DDS security here" in started.stderr and "Traceback" not in started.stderr
