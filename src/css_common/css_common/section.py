# SPDX-License-Identifier: Apache-2.0
"""A section of a mission that several nodes share, as the package that knows what it means states it."""

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import numpy as np

from css_common.schema import Table, Values


def no_conflicts(values: Values) -> Iterable[str]:
    """Of a section whose values are right as long as each one is."""
    return ()


class Section(NamedTuple):
    """Parameters below one name, with the checks that one value alone cannot pass or fail.

    Attributes:
        table: its parameters, with whole names (`orbit.altitude`).
        conflicts: what is wrong between the values below its name, one message each: key, value, what was expected.
    """

    table: Table
    conflicts: Callable[[Values], Iterable[str]] = no_conflicts


def unit_rows(name: str, rows: np.ndarray, least: int, most: int) -> Iterator[str]:
    """What is wrong with (N, 3) directions of which there have to be `least` to `most`."""
    if not least <= len(rows) <= most:
        yield f"{name}: {len(rows)} rows given, expected {least} to {most}"
    for i, length in enumerate(np.linalg.norm(rows, axis=1)):
        if abs(length - 1.0) > 1e-6:
            yield f"{name}: row {i} has length {length:.6g}, expected unit vectors"
