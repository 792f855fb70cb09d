# SPDX-License-Identifier: Apache-2.0
"""For what may be None in general and must be there in a test."""

from typing import TypeVar

T = TypeVar("T")


def present(value: T | None) -> T:
    """The value, which has to be one."""
    assert value is not None
    return value
