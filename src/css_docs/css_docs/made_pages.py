# SPDX-License-Identifier: Apache-2.0
"""All pages that are made from the code."""

from pathlib import Path, PurePosixPath

from css_docs.algorithm_pages import runs
from css_docs.reference import messages, mission_keys, node_pages, verbs


def made_pages(root: Path) -> dict[PurePosixPath, str]:
    """Their text by their path in the site."""
    made = (*node_pages.pages(root, runs(root)), *verbs.pages(root), *messages.pages(root), *mission_keys.pages(root))
    return dict(made)
