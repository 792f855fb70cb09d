# SPDX-License-Identifier: Apache-2.0
"""Which parameters a file gives to which node, as ROS finds them.

A section is for the nodes whose full name it matches: `/**` stands for any number of names, `/*` for one. All that
match count, in the order in which they stand, a later one over an earlier one.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from typing import Any

SHARED = "/**"
Sections = Mapping[str, Mapping[str, Any]]
"""Section to flat parameters, in the order of the file."""

_ANY_NODE = "0"  # no node can have this name, so that a section that matches it is for all of a namespace


@cache
def _expression(section: str) -> re.Pattern[str]:
    pattern = ("/" + section.lstrip("/")).replace("/**", r"(/\w+)*").replace("/*", r"(/\w+)")
    return re.compile(pattern, re.ASCII)


def is_for(section: str, name: str, namespace: str = "/") -> bool:
    """Whether a section is for the node of that name."""
    full_name = f"{namespace.rstrip('/')}/{name}"
    if "*" not in section:
        return section.lstrip("/") == full_name[1:]
    return _expression(section).fullmatch(full_name) is not None


def is_shared(section: str, namespace: str = "/") -> bool:
    """Whether a section is for every node of a namespace."""
    return is_for(section, _ANY_NODE, namespace)


def given_to(sections: Sections, name: str, namespace: str = "/") -> dict[str, Any]:
    """What a node is given, its own parameters and others."""
    return _merged(sections, lambda section: is_for(section, name, namespace))


def shared_by_all(sections: Sections, namespace: str = "/") -> dict[str, Any]:
    """What every node of a namespace is given."""
    return _merged(sections, lambda section: is_shared(section, namespace))


def _merged(sections: Sections, counts: Callable[[str], bool]) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for section, parameters in sections.items():
        if counts(section):
            result.update((key, value) for key, value in parameters.items() if not belongs_to_ros(key))
    return result


def with_shared(sections: Sections, key: str, value: Any) -> dict[str, dict[str, Any]]:
    """Sections in which a parameter has another value for all nodes, but for those that have one of their own."""
    result: dict[str, dict[str, Any]] = {SHARED: {}}  # first, or it would count more than what is there
    result.update((name, dict(parameters)) for name, parameters in sections.items())
    for name, parameters in result.items():
        if name == SHARED or (is_shared(name) and key in parameters):
            parameters[key] = value
    return result


def with_own(sections: Sections, node: str, key: str, value: Any) -> dict[str, dict[str, Any]]:
    """Sections in which a parameter has another value for one node."""
    result = {name: dict(parameters) for name, parameters in sections.items()}
    place = next((name for name in result if name.lstrip("/") == node), node)
    result.setdefault(place, {})[key] = value
    given = given_to(result, node)
    if given[key] != value:
        # A section for more than this node stands after it and says otherwise: last, with all that is in force.
        own = {name: given.get(name, old) for name, old in result.pop(place).items()}
        result[place] = own | {key: value}
    return result


def belongs_to_ros(name: str) -> bool:
    """True for parameters that every ROS node has, whoever wrote it: quality-of-service overrides, simulated time."""
    return name.startswith("qos_overrides.") or name in ("use_sim_time", "start_type_description_service")


def merged_files(files: Iterable[Sections]) -> dict[str, dict[str, Any]]:
    """The sections of several files: a section stands where it came first, with the values that came last."""
    result: dict[str, dict[str, Any]] = {}
    for sections in files:
        for section, parameters in sections.items():
            result.setdefault(section, {}).update(parameters)
    return result
