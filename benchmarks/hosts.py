# SPDX-License-Identifier: Apache-2.0
"""Hosts of a small network on one machine: network namespaces with an address each, cabled to one switch.

Nobody needs to be root: all of it is in a user namespace of its own (`enter`), where the kernel permits one.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence

_INSIDE = "SUNPOINT_INSIDE_NAMESPACE"
_SWITCH = "switch"
_PROBE = (
    "mount -t tmpfs none /run && ip netns add probe && ip link add probe0 type bridge"
    " && ip link add probe1 type veth peer name probe2 netns probe"
)


def refusal() -> str:
    """Why this machine has no place for such a network; empty when it has."""
    for program in ("unshare", "nsenter", "ip", "mount"):
        if shutil.which(program) is None:
            return f"there is no {program} on this machine"
    tried = subprocess.run([*_unshare(), "sh", "-c", _PROBE], capture_output=True, text=True, check=False)
    return f"no network namespaces here: {tried.stderr.strip()}" if tried.returncode else ""


def enter() -> None:
    """Starts this program again in namespaces of its own, if it is not in them yet."""
    if _INSIDE not in os.environ:
        os.environ[_INSIDE] = "1"
        command = [*_unshare(), sys.executable, *sys.argv]
        os.execvp(command[0], command)


def _unshare() -> list[str]:
    return ["unshare", "--map-root-user", "--net", "--mount", "--propagation", "private"]


class Network:
    """Hosts with the addresses 10.93.0.1, 10.93.0.2, ...; to be used after `enter`."""

    def __init__(self, names: Sequence[str]) -> None:
        """Cables them; the first thing that fails is raised as CalledProcessError."""
        _run("mount", "-t", "tmpfs", "none", "/run")
        _run("ip", "link", "add", "name", _SWITCH, "type", "bridge", "mcast_snooping", "0")
        _run("ip", "link", "set", "dev", _SWITCH, "up")
        for number, name in enumerate(names, 1):
            _run("ip", "netns", "add", name)
            end = ["name", "eth0", "address", _hardware(number), "netns", name]
            _run("ip", "link", "add", "name", name, "type", "veth", "peer", *end)
            _run("ip", "link", "set", "dev", name, "master", _SWITCH, "up")
            for command in ("link set lo up", f"addr add 10.93.0.{number}/24 dev eth0", "link set eth0 up"):
                _run("ip", "-n", name, *command.split())
            _run("ip", "-n", name, "route", "add", "default", "dev", "eth0")  # multicast too
            for other in range(1, len(names) + 1):  # addresses are fixed, as on board: nobody asks for them
                if other != number:
                    known = [f"10.93.0.{other}", "lladdr", _hardware(other), "dev", "eth0", "nud", "permanent"]
                    _run("ip", "-n", name, "neigh", "add", *known)

    def on(self, name: str, command: Sequence[str]) -> list[str]:
        """A command as it runs on a host."""
        return ["nsenter", f"--net=/run/netns/{name}", *command]

    def cut(self, name: str) -> None:
        """Pulls the cable of a host out of the switch; it keeps its address and notices nothing but silence."""
        _run("ip", "link", "set", "dev", name, "nomaster")

    def mend(self, name: str) -> None:
        """Puts it back."""
        _run("ip", "link", "set", "dev", name, "master", _SWITCH)


def _hardware(number: int) -> str:
    return f"02:00:00:00:00:{number:02x}"


def _run(*command: str) -> None:
    subprocess.run(command, check=True)
