# SPDX-License-Identifier: Apache-2.0
"""DDS security of a flight: keystore and enclaves in the environment, and never a flight that only seems to be secure.

Where the middleware has no security, rcl flies on without it when nothing enforces it. Whoever asks for security is
therefore answered by a trial in a process of its own, before anything starts. Standard library only.
"""

import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, MutableMapping
from contextlib import contextmanager
from pathlib import Path

ENABLE = "ROS_SECURITY_ENABLE"
STRATEGY = "ROS_SECURITY_STRATEGY"
KEYSTORE = "ROS_SECURITY_KEYSTORE"
ENCLAVE = "ROS_SECURITY_ENCLAVE_OVERRIDE"
_TRIED = "SUNPOINT_SECURITY_TRIED"

ROOT = "/sunpoint"
"""Enclave of a flight in one process; below it those of the nodes that are processes."""

_FILES = ("identity_ca.cert.pem", "cert.pem", "key.pem", "permissions_ca.cert.pem", "governance.p7s", "permissions.p7s")
_TRIAL = "import rclpy; from rclpy.node import Node; rclpy.init(args=['trial']); Node('trial')"
_LACKING = re.compile("doesn't have the security libraries|does not have security support", re.I)


class SecurityError(Exception):
    """Security that was asked for and cannot be had; one line with what would be right."""


def is_asked_for(environ: Mapping[str, str]) -> bool:
    """Whether ROS is told to be secure, in the words that rcl understands."""
    return environ.get(ENABLE) == "true"


def check(environ: MutableMapping[str, str]) -> None:
    """Looks whether the middleware has the security that the environment asks for; nothing where it asks for none.

    Raises:
        SecurityError: it has none.
    """
    if not is_asked_for(environ) or environ.get(_TRIED) == "1":
        return
    with tempfile.TemporaryDirectory(prefix="sunpoint-security-") as store:
        (Path(store) / "enclaves" / "trial").mkdir(parents=True)
        asked = {KEYSTORE: store, STRATEGY: "Enforce", ENCLAVE: "/trial", "ROS_LOG_DIR": store}
        tried = subprocess.run(
            [sys.executable, "-c", _TRIAL], env={**environ, **asked}, capture_output=True, text=True, check=False
        )
    if lacks_security(tried.stderr):
        middleware = environ.get("RMW_IMPLEMENTATION", "the middleware")
        raise SecurityError(
            f"{ENABLE}=true: {middleware} is built without DDS security here, and nothing flies as if it had it; "
            "expected a full ROS 2 Jazzy, or no security"
        )
    environ[_TRIED] = "1"  # nodes that are started need not try again


def lacks_security(complaint: str) -> bool:
    """Whether a middleware complains that it was built without security, in the words of Fast DDS or Cyclone DDS."""
    return bool(_LACKING.search(complaint))


@contextmanager
def enforced(environ: MutableMapping[str, str], keystore: Path | None, enclaves: Iterable[str]) -> Iterator[None]:
    """Everything that is started inside is secure by a keystore, or does not start.

    Args:
        environ: of this process.
        keystore: as SROS 2 makes it; None: as the environment says.
        enclaves: that must be in it.

    Raises:
        SecurityError: the keystore lacks something.
    """
    before = dict(environ)
    if keystore is not None:
        for enclave in enclaves:
            _check_enclave(keystore, enclave)
        environ.update({ENABLE: "true", STRATEGY: "Enforce", KEYSTORE: str(keystore.absolute()), ENCLAVE: ROOT})
    try:
        yield
    finally:
        for name in (ENABLE, STRATEGY, KEYSTORE, ENCLAVE, _TRIED):
            environ.pop(name, None)
            environ.update({name: before[name]} if name in before else {})


def of_process(environ: Mapping[str, str], node: str) -> dict[str, str]:
    """What the environment of a node's process has besides: its own enclave, where the flight has one of its own."""
    return {ENCLAVE: f"{ROOT}/{node}"} if is_asked_for(environ) and environ.get(ENCLAVE) == ROOT else {}


def enclaves_of(nodes: Iterable[str], processes: bool) -> list[str]:
    """Enclaves of a flight: one for the one process, or one for each node."""
    return [f"{ROOT}/{node}" for node in nodes] if processes else [ROOT]


def _check_enclave(keystore: Path, enclave: str) -> None:
    if not (keystore / "enclaves").is_dir():
        raise SecurityError(f"--security {keystore}: no keystore, expected one of `ros2 security create_keystore`")
    folder = keystore / "enclaves" / enclave.strip("/")
    lacking = [name for name in _FILES if not (folder / name).exists()]
    if lacking:
        what = f"no {', '.join(lacking)} in the enclave {enclave}" if folder.is_dir() else f"no enclave {enclave}"
        raise SecurityError(
            f"--security {keystore}: {what}, expected that of `ros2 security create_enclave {keystore} {enclave}`"
        )
