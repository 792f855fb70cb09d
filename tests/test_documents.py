# SPDX-License-Identifier: Apache-2.0
"""Every block of code of the documents is run, or says why not; what it is said to print, it prints."""

import contextlib
import io
import os
import subprocess
import sys
from pathlib import Path

import pytest
from marked_blocks import PAGES, ROOT, Block, blocks, missing

_LINKED = ("sunpoint", "docs", "config", "benchmarks", "src", "Dockerfile")


def name(page: Path) -> str:
    return page.relative_to(ROOT / "docs").as_posix()


def pages_with(*marks: str) -> list:
    return [pytest.param(p, id=name(p)) for p in PAGES if any(block.mark in marks for block in blocks(p))]


@pytest.mark.parametrize("page", [pytest.param(page, id=name(page)) for page in PAGES])
def test_every_block_has_a_mark(page):
    bare = [f"{name(page)}:{block.line}" for block in blocks(page) if not block.mark]
    assert bare == [], "a comment in the line before says <!-- run -->, <!-- run long -->, ...: src/css_docs/README.md"


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """A folder as a checkout is, in which nothing is left of what blocks write."""
    for linked in _LINKED:
        (tmp_path / linked).symlink_to(ROOT / linked)
    (tmp_path / "bags").mkdir()
    (tmp_path / "bags" / "reference").symlink_to(ROOT / "bags" / "reference")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run_page(page: Path, folder: Path, long: bool) -> None:
    """Runs the blocks of a page in their order.

    Args:
        long: those marked `run long`, too.
    """
    # compiled code of a page's own package belongs to the classes of one import
    apart = any(block.mark == "file" and block.detail.endswith(".py") for block in blocks(page))
    names: dict = {"__name__": "__main__"}
    printed: str | None = None
    for block in blocks(page):
        where = f"{name(page)}:{block.line}"
        if block.mark == "file":
            file = folder / block.detail
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(block.text, encoding="utf-8")
        elif block.mark == "run" or (long and block.mark == "run long"):
            command = ["bash", "-e", "-c"] if block.language != "python" else [sys.executable, "-c"] if apart else []
            printed = run(command, block, folder, where) if command else python(block, names, where)
        elif block.mark == "output":
            assert printed is None or missing(block.text, printed) == [], f"{where}: not in\n{printed}"
        if block.mark in ("illustrative", "run long") and not (long and block.mark == "run long"):
            printed = None  # what follows is the output of what has not been run


def python(block: Block, names: dict, where: str) -> str:
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(block.text, where, "exec"), names)
    return out.getvalue()


def run(command: list[str], block: Block, folder: Path, where: str) -> str:
    env = {**os.environ, "TERM": "dumb", "COLUMNS": "200"}
    if block.language == "python":
        env["PYTHONPATH"] = os.pathsep.join(filter(None, (str(folder), env.get("PYTHONPATH"))))
    env.pop("SUNPOINT_VERB", None)
    done = subprocess.run(
        [*command, block.text], cwd=folder, env=env, capture_output=True, text=True, timeout=900, check=False
    )
    assert done.returncode == 0, f"{where}: exit code {done.returncode}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
    return done.stdout


@pytest.mark.parametrize("page", pages_with("run"))
def test_short_blocks_run(page, folder):
    run_page(page, folder, long=False)


@pytest.mark.timeout(3000)
@pytest.mark.parametrize("page", pages_with("run long"))
def test_long_blocks_run(page, folder):
    run_page(page, folder, long=True)


def test_an_output_that_is_not_printed_is_found():
    assert missing("a\n...\nb ... c\n", "a\nx\nb 12 c\n") == []
    assert missing("a\nb\n", "b\na\n") == ["b"]
    assert missing("b ... d\n", "b 12 c\n") == ["b ... d"]


def test_speeds_of_the_comparison_are_those_of_the_readme():
    rows = [line for line in (ROOT / "docs" / "comparison.md").read_text().splitlines() if line.startswith("| with")]
    assert len(rows) == 2
    readme = (ROOT / "README.md").read_text().splitlines()
    for row in rows:
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        assert any([c.strip() for c in line.strip("|").split("|")][1:] == cells[1:] for line in readme), row
