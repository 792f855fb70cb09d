# SPDX-License-Identifier: Apache-2.0
"""Counts of a timer of 32 bits as counts of one that never begins anew."""

from css_sensors.slits import counts_between


class UnwrappedTimer:
    """Follows a timer over its wraps; readings less than half a wrap apart are told from each other."""

    def __init__(self) -> None:
        self._last: int | None = None

    def follow(self, count: int) -> int:
        """The reading without wraps; a count a little before the last one is one that came late."""
        if self._last is None:
            self._last = count
        else:
            self._last += counts_between(count, self._last)
        return self._last
