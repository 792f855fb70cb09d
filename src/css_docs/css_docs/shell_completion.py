# SPDX-License-Identifier: Apache-2.0
"""Completion scripts of all verbs, made by shtab from their parsers."""

import argparse
import re
from pathlib import Path

import shtab

from css_docs.reference.verbs import parser_of, table_of_verbs

_PROG = "sunpoint"
_MISSION = {"bash": "_sunpoint_mission", "zsh": "_sunpoint_mission"}
_MISSIONS_BASH = """\
_sunpoint_mission() {{
  compgen -W "{names}" -- "$1"
  compgen -f -- "$1"
}}
"""
_MISSIONS_ZSH = """\
_sunpoint_mission() {{
  _alternative 'missions:mission:({names})' 'files:file:_files'
}}
"""
_OPTION = re.compile(r"^\s+(--[\w-]+)", re.MULTILINE)


def completion(root: Path, shell: str) -> str:
    """The script.

    Args:
        root: of the checkout.
        shell: `bash` or `zsh`.
    """
    names = " ".join(sorted(file.stem for file in (root / "config").glob("*.yaml")))
    preamble = {"bash": _MISSIONS_BASH.format(names=names), "zsh": _MISSIONS_ZSH.format(names=names)}
    return shtab.complete(all_verbs(root), shell=shell, preamble=preamble)


def all_verbs(root: Path) -> argparse.ArgumentParser:
    """One parser with a subparser for each verb."""
    table = table_of_verbs(root)
    parser = argparse.ArgumentParser(_PROG)
    parser.add_argument("--version", action="store_true", help="say which version this is")
    verbs = parser.add_subparsers(metavar="VERB")
    for name, entry in table.VERBS.items():
        parents = [parser_of(root, name, entry)] if entry.package else []
        # the parent has its --help, the parsers of verbs without an executable need one
        verb = verbs.add_parser(name, help=entry.summary, parents=parents, add_help=not parents)
        for option in _OPTION.findall(table.JOINING_OPTIONS if name in table.JOINING else ""):
            verb.add_argument(option, metavar="FLIGHT")
        for action in verb._actions:
            _complete(action)
    return parser


def _complete(action: argparse.Action) -> None:
    """Says what completes an argument that has no choices of its own."""
    if action.choices is not None or action.nargs == 0:
        return
    if action.dest == "mission":
        action.complete = _MISSION  # type: ignore[attr-defined]
    elif action.type is Path:
        action.complete = shtab.FILE  # type: ignore[attr-defined]
