# SPDX-License-Identifier: Apache-2.0
"""Prints the completion script of a shell."""

import argparse

from css_common import places
from css_docs.errors import DocsError


def run(options: argparse.Namespace) -> int:
    """Prints the script; the exit code.

    Raises:
        DocsError: this is no checkout, or what makes such scripts is not installed.
    """
    root = places.home().absolute()
    if not (root / "tools" / "bootstrap").is_dir():
        raise DocsError(f"{root}: has no tools/bootstrap, expected the folder of a checkout ({places.HOME})")
    try:
        from css_docs.shell_completion import completion
    except ModuleNotFoundError as error:
        raise DocsError(f"{error.name} is not installed; ./sunpoint completion installs what it needs") from error
    print(completion(root, options.shell))
    return 0
