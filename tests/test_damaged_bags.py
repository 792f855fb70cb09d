# SPDX-License-Identifier: Apache-2.0
"""Damaged recordings are read, replayed, recovered or refused in words: none gives anything wrong."""

import json
import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).parents[1] / "benchmarks" / "damaged_bags.py"


def test_forty_damaged_recordings_give_nothing_wrong():
    run = subprocess.run(
        [sys.executable, str(SCRIPT), "--count", "40", "--seed", "4"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    result = json.loads(run.stdout.splitlines()[-1])
    assert result["failures"] == []
    for action in ("read", "replay", "recover"):
        outcomes = result[action]
        assert sum(outcomes.values()) == 40
        assert outcomes["identical"] > 0
        assert outcomes.get("refused", 0) + outcomes.get("loss named", 0) > 0
