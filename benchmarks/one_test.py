# SPDX-License-Identifier: Apache-2.0
"""A pytest plugin that notes which test is under way, the processor time at which it began, and which one failed.

Names are read from here rather than from what pytest prints: parameters may hold spaces and dashes.
"""

import json
import os
import resource
from pathlib import Path
from typing import Any


def pytest_runtest_logstart(nodeid: str) -> None:
    """Written before the test, for whoever finds the process ended."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    _note({"test": nodeid, "cpu_s": used.ru_utime + used.ru_stime})


def pytest_runtest_logreport(report: Any) -> None:
    """Written when a test, or what it needs, fails; with `-x` nothing comes after it."""
    if report.failed:
        _note({"failed": report.nodeid})


def pytest_collectreport(report: Any) -> None:
    """A file that cannot be imported fails as a whole."""
    if report.failed:
        _note({"failed": report.nodeid})


def _note(entries: dict[str, Any]) -> None:
    file = Path(os.environ["MUTANT_PROGRESS"])
    before = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    file.write_text(json.dumps(before | entries), encoding="utf-8")
