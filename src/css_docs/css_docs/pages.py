# SPDX-License-Identifier: Apache-2.0
"""Which files of the repository are pages of the site, and where they stand in it."""

from collections.abc import Iterator
from pathlib import Path, PurePosixPath

DOCS = "docs"
PROJECT = "project"
PACKAGES = "packages"
SOURCE = "source"
"""Folder of the site for files of the repository that are linked and are no pages."""


def written_pages(root: Path) -> dict[PurePosixPath, PurePosixPath]:
    """Every page that is written by hand: its path in the repository to that in the site."""
    return {path: page_of(path) for path in _markdown(root)}


def _markdown(root: Path) -> Iterator[PurePosixPath]:
    patterns = ("*.md", f"{DOCS}/**/*.md", "src/*/README.md", "benchmarks/README.md", "bags/README.md")
    for pattern in patterns:
        for file in sorted(root.glob(pattern)):
            yield PurePosixPath(file.relative_to(root).as_posix())


def page_of(path: PurePosixPath) -> PurePosixPath:
    """Where a page of the repository stands in the site."""
    match path.parts:
        case ("docs", *rest):
            return PurePosixPath(*rest)
        case ("src", package, "README.md"):
            return PurePosixPath(PACKAGES, f"{package}.md")
        case (folder, "README.md"):
            return PurePosixPath(PROJECT, f"{folder}.md")
        case _:
            return PurePosixPath(PROJECT, path.name.lower())
