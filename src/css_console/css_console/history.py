# SPDX-License-Identifier: Apache-2.0
"""What the strip charts show so far, in bounded memory, for browsers that come late."""

from collections.abc import Sequence

import numpy as np

MOST = 6000
"""Rows that are kept."""
_BUCKET = 4


class History:
    """Rows of time and values. When there are too many, they are thinned to their extremes: no peak is lost."""

    def __init__(self, width: int, most: int = MOST) -> None:
        """Empty.

        Args:
            width: values in a row.
            most: rows that are kept, a multiple of four.
        """
        self._rows = np.empty((most, 1 + width))
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def add(self, time_s: float, values: Sequence[float]) -> None:
        """One row more, or another one in the place of the last when that is of the same time.

        Args:
            time_s: not before that of the last row.
            values: not a number where there is none.
        """
        if self._count and self._rows[self._count - 1, 0] == time_s:
            self._count -= 1
        if self._count == len(self._rows):
            self._thin()
        self._rows[self._count, 0] = time_s
        self._rows[self._count, 1:] = values
        self._count += 1

    def rearranged(self, places: Sequence[int | None]) -> "History":
        """The same rows with other values.

        Args:
            places: where each value was before; None: it was not.
        """
        other = History(len(places), len(self._rows))
        other._count = self._count
        other._rows[: self._count, 0] = self._rows[: self._count, 0]
        for column, place in enumerate(places, 1):
            values = np.nan if place is None else self._rows[: self._count, 1 + place]
            other._rows[: self._count, column] = values
        return other

    def columns(self) -> np.ndarray:
        """Time and values, (1 + width, count)."""
        return self._rows[: self._count].T

    def _thin(self) -> None:
        """Of each few rows the smallest and the largest of every value: half as many."""
        old = self._rows.reshape(-1, _BUCKET, self._rows.shape[1])
        # fmin and fmax pass over what is not a number, unless there is nothing else
        low, high = np.fmin.reduce(old, axis=1), np.fmax.reduce(old, axis=1)
        low[:, 0], high[:, 0] = old[:, 0, 0], old[:, -1, 0]
        self._count = 2 * len(old)
        self._rows[0 : self._count : 2], self._rows[1 : self._count : 2] = low, high
