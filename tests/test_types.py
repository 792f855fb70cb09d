# SPDX-License-Identifier: Apache-2.0
"""mypy over everything, as one of the tests: a processor that flights leave idle has time for it."""

import subprocess
import sys
from pathlib import Path

from bootstrap.checks import TYPES

ROOT = Path(__file__).parents[1]


def test_types_fit():
    done = subprocess.run([sys.executable, "-m", *TYPES], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
