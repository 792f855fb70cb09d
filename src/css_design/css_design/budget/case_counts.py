# SPDX-License-Identifier: Apache-2.0
"""How many cases a budget flies unless told."""

CASES = 40
QUICK_CASES = 8
