# SPDX-License-Identifier: Apache-2.0
"""A line now and then where there is no terminal, and none for what is soon done."""

import re
import threading
from types import SimpleNamespace

from noting import noted

from css_common import progress_lines
from css_common.progress_lines import ProgressLines, still_working
from css_common.testing import DEADLINE


def test_a_line_every_ten_seconds(capsys):
    wall = SimpleNamespace(now=100.0)
    lines = ProgressLines("flying okeefe_2013", "s simulated", lambda: wall.now)
    for seconds in range(25):
        wall.now = 100.0 + seconds
        lines.tell(50.0 * seconds, 5550.0)
    said = [f"flying okeefe_2013: {done} of 5550 s simulated" for done in (500, 1000)]
    assert capsys.readouterr().err.splitlines() == said


def test_what_is_soon_done_says_nothing(capsys):
    with still_working("replaying"):
        pass
    assert capsys.readouterr().err == ""


def test_what_takes_long_says_so_until_it_ends(capsys, monkeypatch):
    told = threading.Semaphore(0)
    monkeypatch.setattr(progress_lines, "EVERY", 0.0)
    say = progress_lines._say
    monkeypatch.setattr(progress_lines, "_say", lambda line: noted([], say(line), told.release))
    with still_working("replaying bags/a"):
        assert told.acquire(timeout=DEADLINE)
    lines = capsys.readouterr().err.splitlines()
    assert lines and all(re.fullmatch(r"replaying bags/a: \d+ s of wall time so far", line) for line in lines)
    assert all(thread.name != "progress" for thread in threading.enumerate())
