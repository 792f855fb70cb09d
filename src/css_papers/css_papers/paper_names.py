# SPDX-License-Identifier: Apache-2.0
"""Which papers there are, without loading any."""

from pathlib import Path


def paper_names() -> list[str]:
    """Names of the papers, in the order of the alphabet."""
    return sorted(file.parent.name for file in Path(__file__).parent.glob("*/paper.py"))
