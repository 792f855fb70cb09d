# SPDX-License-Identifier: Apache-2.0
"""Which ROS domain `shell`, `record` and `play` work in: that of the running flight, unless told otherwise."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from bootstrap.project import Refusal
from css_common.domains import JOINED, Holder, flights
from css_common.network import DOMAIN, domain_number, domain_of


class Wish(NamedTuple):
    """What the command line asks to join; None where it is silent."""

    flight: str | None = None
    domain: str | None = None


def split_wish(arguments: list[str], *, before_words: bool) -> tuple[Wish, list[str]]:
    """Takes `--flight` and `--domain` out of a command line; what is left.

    Args:
        arguments: of the verb.
        before_words: they stand before the first word that is no option; after it everything is another command's.

    Raises:
        Refusal: one of them has no value.
    """
    found: dict[str, str] = {}
    rest: list[str] = []
    words = iter(arguments)
    for word in words:
        name, equals, value = word.partition("=")
        if word in ("-c", "--", "--ros-args") or (before_words and not word.startswith("-")):
            rest += [word, *words]
        elif name not in ("--flight", "--domain"):
            rest.append(word)
        elif equals:
            found[name[2:]] = value
        else:
            given = next(words, None)
            if given is None:
                raise Refusal(f"{name} needs a value", exit_code=2)
            found[name[2:]] = given
    return Wish(**found), rest


def join(environ: Mapping[str, str], wish: Wish, *, must_choose: bool) -> tuple[dict[str, str], str]:
    """The environment in which the verb finds its flight, and what says which ROS domain that is and why.

    Args:
        environ: as the verb would have it.
        wish: what the command line asks for.
        must_choose: of several flights one must be named; a shell is good for more than a flight.

    Raises:
        Refusal: several flights are running and one must be chosen, or none is of the name.
        NetworkError: a number is none of a domain.
    """
    env = dict(environ)
    if wish.domain is not None:
        return _enter(env, domain_number(wish.domain, "--domain"), "--domain")
    if wish.flight is not None:
        return _enter_flight(env, _chosen(wish.flight, flights()))
    given = domain_of(env)
    joined = env.pop(JOINED, None)
    if given is not None and str(given) != joined:
        return env, f"ROS domain {given}: ROS_DOMAIN_ID"
    env.pop(DOMAIN, None)
    running = [flight for flight in flights() if flight.kind]  # another user's is joined by name alone
    for flight in running:
        if flight.domain == given:
            return _enter_flight(env, flight)
    if not running:
        return env, "ROS domain 0: no flight is running"
    if len(running) > 1 and not must_choose:
        return env, f"ROS domain 0: {_several(running)}\n  {_listed(running)}"
    return _enter_flight(env, _chosen("", running))


def _chosen(wanted: str, running: list[Holder]) -> Holder:
    matching = [flight for flight in running if not wanted or wanted in _names(flight)]
    if len(matching) == 1:
        return matching[0]
    if not matching:
        raise Refusal(f"no flight '{wanted}' is running", _listed(running), exit_code=2)
    raise Refusal(_several(matching), _listed(matching), exit_code=2)


def _several(running: list[Holder]) -> str:
    return f"{len(running)} flights are running, choose with --flight NAME|PID or --domain N"


def _listed(running: list[Holder]) -> str:
    return "\n  ".join(f"domain {flight.domain}: {flight}" for flight in running)


def _names(flight: Holder) -> tuple[str, ...]:
    return flight.name, str(flight.pid), flight.recording, Path(flight.recording).name


def _enter_flight(env: dict[str, str], flight: Holder) -> tuple[dict[str, str], str]:
    env, _ = _enter(env, flight.domain, "")
    env[JOINED] = str(flight.domain)
    return env, f"ROS domain {flight.domain}: joining {flight}"


def _enter(env: dict[str, str], domain: int, why: str) -> tuple[dict[str, str], str]:
    env.pop(JOINED, None)
    env[DOMAIN] = str(domain)
    return env, f"ROS domain {domain}: {why}"
