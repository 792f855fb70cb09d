# SPDX-License-Identifier: Apache-2.0
"""Verbs of `./sunpoint`, each with the help that it prints itself."""

import importlib
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from types import ModuleType
from typing import Any

from css_common.command import CommandParser
from css_docs.reference.text import code, contents, plain, table

FOLDER = PurePosixPath("reference", "verbs")
_WIDTH = "110"

_EXIT_CODES = """\
| code | meaning |
|---|---|
| 0 | as it should be |
| 1 | it ran, and something was not as it should be, or a criterion was missed |
| 2 | what was asked for is wrong |
| 130 | interrupted |

What 1 means of a verb stands in its help. A node that is started by itself ends with 0, 1 or 2 alike.
"""


def table_of_verbs(root: Path) -> ModuleType:
    """The module of the start script that knows the verbs: the only table of them."""
    tools = str(root / "tools")
    if tools not in sys.path:
        sys.path.append(tools)
    return importlib.import_module("bootstrap.verbs")


def parser_of(root: Path, name: str, entry: Any) -> CommandParser:
    """The parser of a verb that has an executable, called as `./sunpoint VERB`."""
    folders = ("nodes", "commands")
    package = root / "src" / entry.package / entry.package
    folder = next(f for f in folders if (package / f / f"{entry.executable}.py").is_file())
    module: Any = importlib.import_module(f"{entry.package}.{folder}.{entry.executable}")
    with _environment(SUNPOINT_VERB=f"{name}:{entry.executable}", COLUMNS=_WIDTH, NO_COLOR="1"):
        return module._parser()  # private to the file, as every command has it


def help_of(root: Path, name: str) -> str:
    """What `./sunpoint VERB --help` prints."""
    verbs = table_of_verbs(root)
    entry = verbs.VERBS[name]
    if not entry.package:
        return verbs.OWN_USAGE[name]
    with _environment(SUNPOINT_VERB=f"{name}:{entry.executable}", COLUMNS=_WIDTH, NO_COLOR="1"):
        return parser_of(root, name, entry).format_help()


@contextmanager
def _environment(**values: str) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def pages(root: Path) -> Iterator[tuple[PurePosixPath, str]]:
    """A page for each verb, and one that lists them with the exit codes."""
    verbs = table_of_verbs(root).VERBS
    rows = [(f"[`{name}`]({name}.md)", plain(entry.summary)) for name, entry in verbs.items()]
    listed = contents(verbs).replace(":maxdepth", ":hidden:\n:maxdepth")
    yield (
        FOLDER / "index.md",
        f"# Verbs\n\nEach is `./sunpoint VERB`; the help on these pages is what `./sunpoint VERB --help` prints.\n\n"
        f"{table(('verb', 'what it does'), rows)}\n## Exit codes\n\n{_EXIT_CODES}\n{listed}",
    )
    for name, entry in verbs.items():
        own = f"It is the executable `{entry.executable}` of [{entry.package}](../../packages/{entry.package}.md).\n"
        text = f"# {name}\n\n{plain(entry.summary[0].upper() + entry.summary[1:])}.\n\n{code(help_of(root, name))}\n"
        yield FOLDER / f"{name}.md", text + (own if entry.package else "")
