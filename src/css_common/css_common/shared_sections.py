# SPDX-License-Identifier: Apache-2.0
"""All sections that missions may have: those of `css_common.sections`, and those that other packages bring.

A package whose `setup.py` says `ros_package(__file__, sections=True)` has them as `SECTIONS` in its module `sections`.
It is found by the mark that this leaves in the index of the installed packages (REP 122), as ROS finds plugins.
"""

import os
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module
from pathlib import Path

from css_common import sections
from css_common.places import SECTIONS_INDEX
from css_common.schema import Parameter, Table, Values
from css_common.section import Section

_INDEX = "AMENT_PREFIX_PATH"


def shared_sections() -> Mapping[str, Section]:
    """Every section by its name."""
    return _sections_below(os.environ.get(_INDEX, ""))


def section_table(name: str) -> Table:
    """Parameters of one section.

    Raises:
        LookupError: no installed package has it.
    """
    found = shared_sections()
    if name not in found:
        raise LookupError(f"no package in {_INDEX} has the mission section {name}, expected one of {', '.join(found)}")
    return found[name].table


def shared_parameters() -> Mapping[str, Parameter]:
    """Every parameter of every section by its name."""
    return _parameters_below(os.environ.get(_INDEX, ""))


def conflicts(values: Values) -> Iterator[str]:
    """What is wrong between the values of the shared sections, one message each: key, value, what was expected."""
    for name, section in shared_sections().items():
        if hasattr(values, name):
            yield from section.conflicts(getattr(values, name))


@cache
def _sections_below(prefixes: str) -> Mapping[str, Section]:
    found = dict(sections.SECTIONS)
    for package in sorted(_packages(prefixes)):
        brought = import_module(f"{package}.sections").SECTIONS
        for name in brought.keys() & found.keys():
            raise LookupError(f"{package} brings the mission section {name}, which another package has, too")
        found |= brought
    return found


@cache
def _parameters_below(prefixes: str) -> Mapping[str, Parameter]:
    return {p.name: p for section in _sections_below(prefixes).values() for p in section.table}


def _packages(prefixes: str) -> set[str]:
    """Packages that bring sections."""
    places = (Path(prefix, SECTIONS_INDEX) for prefix in filter(None, prefixes.split(os.pathsep)))
    return {mark.name for place in places if place.is_dir() for mark in place.iterdir()}
