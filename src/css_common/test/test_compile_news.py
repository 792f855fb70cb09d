# SPDX-License-Identifier: Apache-2.0
"""A first start says what it compiles, in time and in the middle of it; a warm one says nothing."""

import os
import re
import resource
import subprocess
import sys
import threading
from itertools import pairwise
from types import SimpleNamespace

import numba
import pytest
from noting import noted

from css_common.compile_news import EVERY, FIRST, CompileNews, name_of
from css_common.testing import DEADLINE

LINE = r"compiling kernels, once for .* \(usually .*, kept for later starts\): (\d+) in (\d+) s so far, now ([\w. ]+)"


class Said(list):
    """Lines that came, and the wait for one that another thread says."""

    def __init__(self):
        super().__init__()
        self.come = threading.Semaphore(0)

    def __call__(self, line):
        noted(self, line, self.come.release)


@pytest.fixture
def said():
    return Said()


@pytest.fixture
def wall():
    return SimpleNamespace(now=50.0)


@pytest.fixture
def news(said, wall):
    return CompileNews(said, lambda: wall.now)


def counted(line):
    found = re.fullmatch(LINE, line)
    assert found, line
    return found.groups()


def test_what_is_soon_compiled_is_not_said(news, said, wall):
    for _ in range(3):
        news.began("wavg.step")
        wall.now += 0.3 * FIRST
        news.tell()
        news.ended()
        wall.now += 100.0  # of other work
    assert said == []


def test_lines_go_by_the_time_that_is_spent_on_compiling(news, said, wall):
    for number in range(12):
        news.began(f"wavg.step_{number}")
        wall.now += 2.5
        news.tell()
        news.ended()
        wall.now += 100.0
    spent_s = [float(counted(line)[1]) for line in said]
    assert spent_s[0] == pytest.approx(2.5, abs=0.5)
    assert all(b - a == pytest.approx(EVERY, abs=0.5) for a, b in pairwise(spent_s))
    assert [counted(line)[0] for line in said] == ["1", "5", "9"]


def test_the_kernel_that_is_being_compiled_is_named_not_the_last_one_that_was(news, said, wall):
    news.began("loop.fly")
    news.began("wavg.step")
    news.ended()
    wall.now += 2.0 * FIRST
    news.tell()
    assert counted(said[0]) == ("2", f"{2.0 * FIRST:.0f}", "loop.fly")


def test_functions_of_numba_are_neither_counted_nor_named(news, said, wall):
    news.began("loop.fly")
    news.began("")
    wall.now += 2.0 * FIRST
    news.tell()
    assert counted(said[0])[::2] == ("1", "loop.fly")


def test_functions_are_named_with_the_module_if_they_have_one():
    of_a_text: dict = {}
    exec("def made(x):\n    return x", of_a_text)
    of_a_text["made"].__module__ = None
    assert name_of(counted) == "test_compile_news.counted"
    assert name_of(of_a_text["made"]) == "made"
    assert name_of(numba.njit) == ""


def test_a_kernel_that_takes_long_is_told_while_it_lasts(said):
    news = CompileNews(said)
    news.began("loop.fly")
    assert said.come.acquire(timeout=DEADLINE)
    news.ended()
    assert counted(said[0])[2] == "loop.fly"


def test_nothing_waits_once_all_is_compiled(news):
    news.began("loop.fly")
    news.ended()
    assert not news._timer.is_alive() or news._timer.finished.is_set()


PROGRAM = """
import sys
from css_common import compile_news, entry
compile_news.FIRST = 0.0
sys.path.insert(0, {folder!r})
sys.argv = [{folder!r} + "/lib/made_up/compute"]
sys.exit(entry.main())
"""
COMMAND = """
from css_common.kernel import kernel
@kernel
def inner(x):
    return x + 1.0
@kernel
def outer(x):
    return 10.0 * inner(x)
def main():
    print(outer(2.0))
    return 0
"""


def test_a_command_speaks_with_a_cold_cache_or_none_and_is_silent_with_a_warm_one(tmp_path):
    commands = tmp_path / "made_up" / "commands"
    commands.mkdir(parents=True)
    for folder in (commands.parent, commands):
        (folder / "__init__.py").touch()
    (commands / "compute.py").write_text(COMMAND)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}

    def run(most_bytes=resource.RLIM_INFINITY):
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM.format(folder=str(tmp_path))],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, most_bytes)),
        )
        assert done.stdout == "30.0\n"
        return done.stderr

    said = [line for line in run(most_bytes=0).splitlines() if not line.startswith("compiling")]
    assert said == [f"compiled kernels are not kept: {said[0].split(': ')[1]}: cannot be written: File too large"]
    assert counted(run().splitlines()[0])[2].startswith("compute.")
    assert run() == ""
