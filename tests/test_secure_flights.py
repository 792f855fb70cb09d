# SPDX-License-Identifier: Apache-2.0
"""A flight that is asked to be secure is, or is refused."""

import os

import pytest

from css_bringup.commands import demo, fly
from css_common import security


def has_security() -> bool:
    try:
        security.check({**os.environ, "ROS_SECURITY_ENABLE": "true"})
    except security.SecurityError:
        return False
    return True


pytestmark = pytest.mark.skipif(has_security(), reason="this middleware has security")


@pytest.mark.parametrize("arguments", [[], ["--processes"]])
def test_the_environment_is_heard(arguments, monkeypatch, capfd, tmp_path):
    monkeypatch.setenv("ROS_SECURITY_ENABLE", "true")
    bag = tmp_path / "bag"
    assert fly.main(["okeefe_2013", "--duration", "1", "--out", str(bag), *arguments]) == 2
    assert "is built without DDS security here" in capfd.readouterr().err
    assert not bag.exists()


def test_every_command_that_flies_hears_it(monkeypatch, capfd, tmp_path):
    monkeypatch.setenv("ROS_SECURITY_ENABLE", "true")
    assert demo.main(["--out", str(tmp_path / "bag")]) == 2
    assert "is built without DDS security here" in capfd.readouterr().err


def test_a_keystore_does_not_help_a_middleware_without_security(capfd, tmp_path):
    place = tmp_path / "keys" / "enclaves" / "sunpoint"
    place.mkdir(parents=True)
    assert fly.main(["okeefe_2013", "--no-record", "--security", str(tmp_path / "keys")]) == 2
    assert "in the enclave /sunpoint, expected that of" in " ".join(capfd.readouterr().err.split())
    for name in ("identity_ca.cert.pem", "cert.pem", "key.pem", "permissions_ca.cert.pem"):
        (place / name).touch()
    (place / "governance.p7s").touch()
    (place / "permissions.p7s").touch()
    assert fly.main(["okeefe_2013", "--no-record", "--security", str(tmp_path / "keys")]) == 2
    assert "is built without DDS security here" in capfd.readouterr().err
    assert "ROS_SECURITY_ENABLE" not in os.environ
