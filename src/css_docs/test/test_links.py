# SPDX-License-Identifier: Apache-2.0
"""Links of pages between files of the repository become links between pages of the site."""

from pathlib import Path, PurePosixPath

import pytest

from css_docs.links import relinked
from css_docs.pages import page_of
from css_docs.reference.text import plain
from css_docs.staging import Stage


def test_links_are_converted_and_code_is_not():
    text = "[a](x.md) `[b](y.md)` ![c](z.png)\n```sh\n[d](w.md)\n```\n| [e](v.md#h) |\n"
    seen = []

    def convert(target, image):
        seen.append((target, image))
        return target

    assert relinked(text, convert) == text
    assert seen == [("x.md", False), ("z.png", True), ("v.md#h", False)]


@pytest.mark.parametrize(
    ("path", "page"),
    [
        ("README.md", "project/readme.md"),
        ("docs/a/b.md", "a/b.md"),
        ("src/css_sim/README.md", "packages/css_sim.md"),
        ("benchmarks/README.md", "project/benchmarks.md"),
    ],
)
def test_places_of_pages(path, page):
    assert page_of(PurePosixPath(path)) == PurePosixPath(page)


def test_pages_and_the_files_that_they_link_are_laid_out(tmp_path):
    root, folder = tmp_path / "root", tmp_path / "stage"
    write(root / "README.md", "see [a](docs/a.md#part), [code](src/p/p/x.py), [dir](src/p/p), [web](https://x.org)")
    write(root / "docs" / "a.md", "![picture](images/a.png) [back](../README.md) [made](reference/made.md)")
    write(root / "docs" / "images" / "a.png", "png")
    write(root / "src" / "p" / "p" / "x.py", "y = 1\n")
    write(folder / "old.md", "of an earlier build")
    Stage(root, folder).lay_out({PurePosixPath("reference/made.md"): "[x](repo:src/p/p/x.py)"}, {})
    readme = (folder / "project" / "readme.md").read_text()
    assert "[a](../a.md#part)" in readme and "[code](../source/src/p/p/x.py.md)" in readme
    assert "[dir](../source/src/p/p/index.md)" in readme and "(https://x.org)" in readme
    page = (folder / "a.md").read_text()
    assert "![picture](source/docs/images/a.png)" in page and "[made](reference/made.md)" in page
    assert "y = 1" in (folder / "source/src/p/p/x.py.md").read_text()
    assert "[x](../source/src/p/p/x.py.md)" in (folder / "reference/made.md").read_text()
    assert not (folder / "old.md").exists()


def test_what_has_not_changed_is_not_written(tmp_path):
    root, folder = tmp_path / "root", tmp_path / "stage"
    write(root / "README.md", "text")
    Stage(root, folder).lay_out({}, {})
    before = (folder / "project/readme.md").stat().st_mtime_ns
    Stage(root, folder).lay_out({}, {})
    assert (folder / "project/readme.md").stat().st_mtime_ns == before


def test_text_of_the_code_is_read_as_it_is():
    assert plain("a_b [rad/s] <x> `c_d|e`") == r"a\_b \[rad/s\] \<x\> `c_d\|e`"


def write(file: Path, text: str) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text)
