# SPDX-License-Identifier: Apache-2.0
"""What of the network a process may use: its own machine, and the ROS domain that is named in its environment.

Standard library only: the start of `./sunpoint` and the tests read it before anything is installed or built.
"""

from collections.abc import Mapping, MutableMapping

DOMAIN = "ROS_DOMAIN_ID"
NETWORK = "SUNPOINT_NETWORK"
LARGEST_DOMAIN = 232  # the ports of a domain begin at 7400 + 250 x domain
_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_PEERS = "ROS_STATIC_PEERS"
_NARROW = ("", "LOCALHOST", "OFF")


class NetworkError(Exception):
    """A setting that means nothing; one line with what was given and what was expected."""


def domain_number(text: str, where: str = DOMAIN) -> int:
    """The number of a ROS domain.

    Args:
        text: as given.
        where: what gave it, for the message.

    Raises:
        NetworkError: it is none.
    """
    if not (text.isascii() and text.isdigit()) or int(text) > LARGEST_DOMAIN:
        raise NetworkError(f"{where}: '{text}' given, expected a whole number from 0 to {LARGEST_DOMAIN}")
    return int(text)


def domain_of(environ: Mapping[str, str]) -> int | None:
    """The domain that the environment names, None without.

    Raises:
        NetworkError: what it names is none.
    """
    text = environ.get(DOMAIN)
    return None if text is None else domain_number(text)


def stay_on_this_machine(environ: MutableMapping[str, str]) -> str:
    """Lets ROS discover this machine alone, unless SUNPOINT_NETWORK says otherwise; what it changed, in one line.

    A variable of ROS that is set for a whole shell or by an administrator must not open a flight to a network.

    Raises:
        NetworkError: SUNPOINT_NETWORK is neither `localhost` nor `subnet`.
    """
    asked = environ.get(NETWORK) or "localhost"
    found = environ.get(_RANGE, "")
    if asked == "subnet":
        if found in ("", "LOCALHOST"):
            environ[_RANGE] = "SUBNET"
        return ""
    if asked != "localhost":
        raise NetworkError(f"{NETWORK}: '{asked}' given, expected localhost or subnet")
    ignored = [f"{_PEERS}={environ.pop(_PEERS)}"] if environ.get(_PEERS) else []
    if found not in _NARROW:
        ignored.insert(0, f"{_RANGE}={found}")
    if found != "OFF":
        environ[_RANGE] = "LOCALHOST"
    return f"{' and '.join(ignored)} ignored, staying on this machine; {NETWORK}=subnet opens it" if ignored else ""
