# SPDX-License-Identifier: Apache-2.0
"""Links of pages between files of the repository, made links between pages of the site."""

import os
import re
from collections.abc import Callable, Iterator
from pathlib import PurePosixPath

_LINK = re.compile(r"(?P<before>!?\[(?:[^\[\]]|\[[^\]]*\])*\]\()(?P<target>[^)\s]+)(?P<after>(?:\s+\"[^\"]*\")?\))")
_FENCE = re.compile(r"^ *(`{3,}|~{3,})")
_CODE = re.compile(r"(`+)(?:(?!\1).)+?\1")


def relinked(text: str, convert: Callable[[str, bool], str]) -> str:
    """A page with the target of each link converted; code is left as it is.

    Args:
        convert: takes a target and whether it is that of an image.
    """
    return "".join(line if is_code else _relinked(line, convert) for line, is_code in lines_of(text))


def lines_of(text: str) -> Iterator[tuple[str, bool]]:
    """Lines of a page with their ends, and whether each is part of a block of code, fences included."""
    fence = ""
    for line in text.splitlines(keepends=True):
        found = _FENCE.match(line)
        if fence:
            yield line, True
            if found and found[1].startswith(fence) and line.strip() == found[1]:
                fence = ""
        elif found:
            fence = found[1]
            yield line, True
        else:
            yield line, False


def _relinked(line: str, convert: Callable[[str, bool], str]) -> str:
    hidden = [found.span() for found in _CODE.finditer(line)]

    def convert_one(found: re.Match[str]) -> str:
        if any(first <= found.start() < end for first, end in hidden):
            return found[0]
        return found["before"] + convert(found["target"], found["before"].startswith("!")) + found["after"]

    return _LINK.sub(convert_one, line)


def is_outside(target: str) -> bool:
    """Whether a target is no file of the repository: another host, or a heading of the same page."""
    return target.startswith("#") or re.match(r"[a-z]+:", target) is not None


def resolved(page: PurePosixPath, target: str) -> tuple[PurePosixPath, str]:
    """Path in the repository, and heading with its mark, that a link of a page leads to."""
    path, mark, heading = target.partition("#")
    return PurePosixPath(os.path.normpath(page.parent / path)), mark + heading


def relative(page: PurePosixPath, target: PurePosixPath) -> str:
    """How a page of the site names another file of it."""
    return os.path.relpath(target, page.parent).replace(os.sep, "/")
