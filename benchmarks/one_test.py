# SPDX-License-Identifier: Apache-2.0
"""A pytest plugin that notes which test is under way, and the processor time at which it began."""

import json
import os
import resource
from pathlib import Path


def pytest_runtest_logstart(nodeid: str) -> None:
    """Written before the test, for whoever finds the process ended."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    note = {"test": nodeid, "cpu_s": used.ru_utime + used.ru_stime}
    Path(os.environ["MUTANT_PROGRESS"]).write_text(json.dumps(note), encoding="utf-8")
