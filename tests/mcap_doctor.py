# SPDX-License-Identifier: Apache-2.0
"""The structure of a recording as another tool sees it. A conftest that imports `doctor` gives it to its tests."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from css_common.testing import DEADLINE


@pytest.fixture(scope="session")
def doctor() -> Callable[[Path], str]:
    """Checks the structure of an MCAP file with `pymcap-cli doctor`; gives what it prints."""

    def check(path: Path) -> str:
        command = [str(Path(sys.executable).with_name("pymcap-cli")), "doctor", str(path)]
        run = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE, check=False)
        assert run.returncode == 0, run.stdout + run.stderr
        return run.stdout

    return check
