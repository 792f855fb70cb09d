# SPDX-License-Identifier: Apache-2.0
"""Options that take numbers take those that they say they take, to the ends of their ranges."""

import argparse
import importlib
import math
import re
from collections.abc import Iterator

import pytest
from listing import ROOT

from bootstrap.verbs import VERBS

_RANGE = re.compile(r"from (?P<low>\S+)( to (?P<high>\S+)| on)|above (?P<above>\S+?)(?P<finite>,|$)")


def actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Options of a parser and of its sub-commands."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for sub in action.choices.values():
                yield from actions(sub)
        else:
            yield action


def said_ranges():
    """What options with a range say when a word is given, by verb and option."""
    for name, verb in sorted(VERBS.items()):
        if not verb.package:
            continue
        files = ROOT.glob(f"src/{verb.package}/*/*/{verb.executable.replace('-', '_')}.py")
        (file,) = (file for file in files if file.parent.name in ("commands", "nodes"))
        for action in actions(importlib.import_module(".".join(file.with_suffix("").parts[-3:]))._parser()):
            if not callable(action.type):
                continue
            try:
                action.type("nan")
            except argparse.ArgumentTypeError as error:
                words = str(error).partition("expected ")[2]
                if _RANGE.search(words):
                    yield pytest.param(action.type, words, id=f"{name} {action.option_strings[0]}")
            except ValueError:
                continue


RANGES = list(said_ranges())


def accepted(kind, value: float) -> bool:
    try:
        return kind(f"{value!r}") == value
    except argparse.ArgumentTypeError:
        return False


@pytest.mark.parametrize(("kind", "words"), RANGES)
def test_an_option_takes_the_range_that_it_says(kind, words):
    found = _RANGE.search(words)
    assert found is not None
    whole = any(word in words for word in ("whole", "port", "bytes"))
    number = int if whole else float
    free = 0 if "or 0 for" in words else None
    if found["above"]:
        bound = number(found["above"].rstrip(","))
        assert not accepted(kind, bound) and accepted(kind, bound + number(1))
        assert whole or accepted(kind, math.nextafter(bound, math.inf))
    else:
        bound = number(found["low"])
        assert accepted(kind, bound) and accepted(kind, bound - 1) is (bound - 1 == free)
        assert whole or not accepted(kind, math.nextafter(bound, -math.inf))
    if found["high"]:
        highest = number(found["high"].rstrip(","))
        assert accepted(kind, highest) and not accepted(kind, highest + 1)
        assert whole or not accepted(kind, math.nextafter(highest, math.inf))
    elif not whole:
        assert accepted(kind, 1e300) and accepted(kind, math.inf) is ("inf" in words)


def test_ranges_are_found():
    names = {parameter.id for parameter in RANGES}
    assert {"play --start", "play --rate", "calibrate --holdout", "layout --tilt", "hil --wait"} <= names
