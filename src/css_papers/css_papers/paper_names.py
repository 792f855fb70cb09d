# SPDX-License-Identifier: Apache-2.0
"""Which papers there are, and how many cases they fly, without loading any."""

from pathlib import Path

CASES, QUICK_CASES = 1000, 40
"""Flights of each configuration, of papers that do not say otherwise."""


def paper_names() -> list[str]:
    """Names of the papers, in the order of the alphabet."""
    return sorted(file.parent.name for file in Path(__file__).parent.glob("*/paper.py"))
