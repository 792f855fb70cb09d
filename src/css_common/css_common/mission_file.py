# SPDX-License-Identifier: Apache-2.0
"""Reading and writing of ROS 2 parameter files, strict where YAML and ROS are silent."""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar

import yaml


class MissionError(Exception):
    """A mission that cannot be flown: one line that names file, key, value and what was expected."""

    def __init__(self, message: str) -> None:
        super().__init__(" ".join(message.splitlines()))


class _Loader(yaml.SafeLoader):
    """Reads plain words as ROS does, and refuses what ROS refuses or would take without a word.

    YAML 1.1 makes an instant of 2013-06-01, 90 of 1:30, a text of 1e-4 and a truth value of the key `off`; the parser
    of ROS does not. Keys that stand twice are an error.
    """

    yaml_implicit_resolvers: ClassVar[dict] = {}  # type: ignore[misc]  # one of the class for PyYAML, too
    bool_values: ClassVar[dict] = yaml.SafeLoader.bool_values | {"y": True, "n": False}

    def fetch_plain(self) -> None:
        super().fetch_plain()
        token = self.tokens[-1]
        if self.flow_level and ":" in token.value:
            line = token.start_mark.line + 1
            raise MissionError(f"line {line}: {token.value} given, expected quotes: ROS reads no colon inside brackets")

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            line = self.peek_event().start_mark.line + 1
            raise MissionError(f"line {line}: aliases are not read by ROS, expected the values themselves")
        return super().compose_node(parent, index)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = set()
        for key_node, _ in node.value:
            line = key_node.start_mark.line + 1
            if not isinstance(key_node, yaml.ScalarNode):
                raise MissionError(f"line {line}: expected a word as key")
            key_node.tag = "tag:yaml.org,2002:str"
            if key_node.value in keys:
                raise MissionError(f"line {line}: {key_node.value} stands twice")
            keys.add(key_node.value)
        return super().construct_mapping(node, deep)


class _Dumper(yaml.SafeDumper):
    """Quotes every text that the loader would read as something else."""


def _plain(tag: str, pattern: str, first: Sequence[str]) -> None:
    expression = re.compile(f"^(?:{pattern})$")
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{tag}", expression, list(first))
    _Dumper.add_implicit_resolver(f"tag:yaml.org,2002:{tag}", expression, list(first))


def _integer(loader: _Loader, node: yaml.ScalarNode) -> int:
    digits = node.value.lower()
    return int(digits, 16 if "x" in digits else 8 if digits.lstrip("+-").startswith("0") else 10)


_Loader.add_constructor("tag:yaml.org,2002:int", _integer)
_truths = ("y", "yes", "n", "no", "true", "false", "on", "off")
_plain("bool", "|".join(form for word in _truths for form in (word, word.title(), word.upper())), "yYnNtTfFoO")
_plain("null", "~|null|Null|NULL|", ["~", "n", "N", ""])
_plain("int", r"[-+]?(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9]\d*)", "-+0123456789")
_plain(
    "float",
    r"[-+]?(\d+\.?\d*[eE][-+]?\d+|\d+\.\d*|\.\d+([eE][-+]?\d+)?|\.(inf|Inf|INF))|\.(nan|NaN|NAN)",
    "-+0123456789.",
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
    except (yaml.YAMLError, ValueError, RecursionError) as error:
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
        section = name.lstrip("/") if name != "/**" else name
        if section in result:
            raise MissionError(f"{origin}: {section} stands twice")
        _refuse_twice(parameters, f"{origin}: {section}")
        result[section] = dict(parameters)
    return result


def _refuse_twice(parameters: Mapping[str, Any], place: str) -> None:
    names = [name for name, _ in _leaves(parameters)]
    for name in names:
        if names.count(name) > 1:
            raise MissionError(f"{place}: {name} stands twice, once as a dotted name")


def flattened(nested: Mapping[str, Any]) -> dict[str, Any]:
    """Dotted names and values of nested parameters."""
    return dict(_leaves(nested))


def _leaves(nested: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in nested.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def dump_sections(parameters: Mapping[str, Mapping[str, Any]]) -> str:
    """A parameter file of section names and flat parameters."""
    document = {
        section: {"ros__parameters": _nested(flat)} for section, flat in parameters.items() if flat
    }
    return yaml.dump(document, Dumper=_Dumper, sort_keys=False, default_flow_style=None, width=110)


def _nested(flat: Mapping[str, Any]) -> dict[str, Any]:
    root: dict[str, Any] = {}
    for name, value in flat.items():
        *path, leaf = name.split(".")
        at = root
        for part in path:
            at = at.setdefault(part, {})
        at[leaf] = value
    return root
