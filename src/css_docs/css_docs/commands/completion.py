# SPDX-License-Identifier: Apache-2.0
"""Prints a script by which a shell completes verbs, options, their choices, missions and files.

It is made from the parsers of the verbs, and knows those that there were when it was made: write it anew after an
update.
"""

from collections.abc import Sequence

from css_common.command import CommandParser, command_parser, guarded, implementation
from css_docs.errors import DocsError

SHELLS = ("bash", "zsh")
_EXAMPLES = (
    "bash > ~/.local/share/bash-completion/completions/sunpoint",
    "zsh > ~/.zfunc/_sunpoint",
)
_NOTES = """\
bash reads the file at the first TAB after `sunpoint`, in shells begun from then on; for the shell that is open:
  source ~/.local/share/bash-completion/completions/sunpoint
zsh reads it from a folder of $fpath, before compinit: fpath=(~/.zfunc $fpath); autoload -U compinit; compinit"""


def _parser() -> CommandParser:
    parser = command_parser("css_docs", "completion", __doc__, _EXAMPLES, notes=_NOTES)
    parser.add_argument("shell", choices=SHELLS, help="shell to print it for")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(arguments)
    run = implementation("css_docs.verbs.completion")
    return guarded(parser.prog, lambda: run(options), (DocsError,))
