# SPDX-License-Identifier: Apache-2.0
"""From the text of a parameter file to maps, lists and words, refusing what ROS refuses or would take in silence.

The text is taken event by event from libyaml, which ROS uses too: nothing in it makes a Python object, aliases cannot
multiply, and no nesting is too deep for the stack.
"""

from typing import Any, NoReturn

import yaml

from css_common.parameter_words import word

_DEEPEST = 32
_TEXT_TAG = "tag:yaml.org,2002:str"


class DocumentError(ValueError):
    """A document that is no parameter file: line and reason."""


def read_document(text: str) -> Any:
    """What stands in a text; None when nothing does.

    Raises:
        DocumentError: it is not valid YAML, or holds what no parameter file may hold.
    """
    builder = _Builder()
    try:
        for event in yaml.parse(text, yaml.CSafeLoader):
            builder.take(event)
    except UnicodeEncodeError as error:
        line = text.count("\n", 0, error.start) + 1
        raise DocumentError(f"not valid YAML: line {line}: {text[error.start]!r} is half a character") from error
    except yaml.YAMLError as error:
        raise DocumentError(f"not valid YAML: {_cause(error)}") from error
    return builder.document


def _cause(error: yaml.YAMLError) -> str:
    if isinstance(error, yaml.MarkedYAMLError):
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}" if mark is not None else None
        return ": ".join(filter(None, (where, error.context, error.problem)))
    return " ".join(str(error).split())


class _Builder:
    """Puts the events of one document together; a key that stands twice is an error."""

    def __init__(self) -> None:
        self.document: Any = None
        self._documents = 0
        self._open: list[dict[str, Any] | list] = []
        self._keys: list[str | None] = []  # for each open map the key whose value comes next; None for a list
        self._path: list[str] = []  # under which key each of them stands
        self._brackets = 0  # how many of the open ones are inside brackets or braces

    def take(self, event: yaml.Event) -> None:
        """One more event."""
        if isinstance(event, yaml.ScalarEvent):
            self._take_scalar(event)
        elif isinstance(event, yaml.CollectionStartEvent):
            self._begin(event)
        elif isinstance(event, yaml.CollectionEndEvent):
            self._open.pop()
            self._keys.pop()
            self._path.pop()
            self._brackets = max(0, self._brackets - 1)
        elif isinstance(event, yaml.AliasEvent):
            _refuse(event, "aliases are not read by ROS, expected the values themselves")
        elif isinstance(event, yaml.DocumentStartEvent):
            self._documents += 1
            if self._documents > 1:
                _refuse(event, "not valid YAML for parameters: a second document begins")

    def _begin(self, event: yaml.CollectionStartEvent) -> None:
        self._refuse_tag(event)
        if self._wants_key():
            _refuse(event, "expected a word as key")
        if len(self._open) >= _DEEPEST:
            _refuse(event, f"not valid YAML for parameters: nested more than {_DEEPEST} deep")
        container: dict[str, Any] | list = {} if isinstance(event, yaml.MappingStartEvent) else []
        self._path.append((self._keys[-1] if self._keys else None) or "")
        self._put(container)
        self._open.append(container)
        self._keys.append(None)
        if event.flow_style or self._brackets:
            self._brackets += 1

    def _take_scalar(self, event: yaml.ScalarEvent) -> None:
        if event.tag != _TEXT_TAG:
            self._refuse_tag(event)
        if not event.style and self._brackets and ":" in event.value:
            _refuse(event, f"{event.value} given, expected quotes: ROS reads no colon inside brackets")
        if self._wants_key():
            if not event.value:
                _refuse(event, "expected a word as key")
            if event.value in self._open[-1]:
                _refuse(event, f"{event.value} stands twice")
            self._keys[-1] = event.value
        else:
            # as in ROS the style of a block, folded or literal, makes no text of a number
            plain = event.tag is None and event.style not in ("'", '"')
            self._put(word(event.value) if plain else event.value)

    def _wants_key(self) -> bool:
        return bool(self._open) and isinstance(self._open[-1], dict) and self._keys[-1] is None

    def _put(self, value: Any) -> None:
        if not self._open:
            self.document = value
            return
        at, key = self._open[-1], self._keys[-1]
        if isinstance(at, dict):
            assert key is not None
            at[key] = value
            self._keys[-1] = None
        else:
            at.append(value)

    def _refuse_tag(self, event: yaml.ScalarEvent | yaml.CollectionStartEvent) -> None:
        if event.tag is None:
            return
        tag = event.tag.replace("tag:yaml.org,2002:", "!!")
        keys = [*self._path, (self._keys[-1] if self._keys else None) or ""]
        place = ".".join(key for key in keys if key not in ("", "ros__parameters"))
        _refuse(event, f"{place}: the tag {tag} is not read by ROS, expected the plain value")


def _refuse(event: yaml.Event, what: str) -> NoReturn:
    assert event.start_mark is not None
    raise DocumentError(f"line {event.start_mark.line + 1}: {what}")
