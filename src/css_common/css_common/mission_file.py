# SPDX-License-Identifier: Apache-2.0
"""Reading and writing of ROS 2 parameter files, strict where YAML and ROS are silent."""

import re
from collections.abc import Mapping
from typing import Any

import yaml


class MissionError(Exception):
    """A mission that cannot be flown: one line that names file, key, value and what was expected."""


class _Loader(yaml.SafeLoader):
    """Refuses keys that stand twice, and reads 1e-4 as a number, as ROS does (YAML 1.1 makes it a text)."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if key in keys:
                raise MissionError(f"line {key_node.start_mark.line + 1}: {key} stands twice")
            keys.add(key)
        return super().construct_mapping(node, deep)


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?(\d+\.?\d*([eE][-+]?\d+)|\d+\.\d*|\.\d+([eE][-+]?\d+)?|\.(inf|nan))$", re.IGNORECASE),
    list("-+0123456789."),
)


def read_sections(text: str, origin: str) -> dict[str, dict[str, Any]]:
    """Node name to nested parameters of a parameter file.

    Raises:
        MissionError: the text is no parameter file.
    """
    try:
        # SafeLoader subclass: builds plain data only
        document = yaml.load(text, _Loader)
    except MissionError as error:
        raise MissionError(f"{origin}: {error}") from error
    except yaml.YAMLError as error:
        raise MissionError(f"{origin}: not valid YAML: {' '.join(str(error).split())}") from error
    if document is None:
        return {}
    if not isinstance(document, Mapping):
        raise MissionError(f"{origin}: expected node names at the top, found {type(document).__name__}")
    result = {}
    for name, body in document.items():
        if not isinstance(body, Mapping) or set(body) != {"ros__parameters"}:
            raise MissionError(f"{origin}: {name}: expected the one key ros__parameters below it")
        parameters = body["ros__parameters"]
        if not isinstance(parameters, Mapping):
            raise MissionError(f"{origin}: {name}: ros__parameters must hold keys and values")
        result[str(name).lstrip("/") if name != "/**" else "/**"] = dict(parameters)
    return result


def flattened(nested: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Dotted names and values of nested parameters."""
    flat: dict[str, Any] = {}
    for key, value in nested.items():
        if isinstance(value, Mapping):
            flat |= flattened(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = value
    return flat


def dump_sections(parameters: Mapping[str, Mapping[str, Any]]) -> str:
    """A parameter file of section names and flat parameters."""
    document = {
        section: {"ros__parameters": _nested(flat)} for section, flat in parameters.items() if flat
    }
    return yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=110)


def _nested(flat: Mapping[str, Any]) -> dict[str, Any]:
    root: dict[str, Any] = {}
    for name, value in flat.items():
        *path, leaf = name.split(".")
        at = root
        for part in path:
            at = at.setdefault(part, {})
        at[leaf] = value
    return root
