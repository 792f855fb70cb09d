# SPDX-License-Identifier: Apache-2.0
"""For stand-ins that note what they are called with."""

from typing import Any


def noted(calls: list[Any], what: Any, result: Any = None) -> Any:
    """The result of a stand-in, after what it was called with is noted."""
    calls.append(what)
    return result() if callable(result) else result
