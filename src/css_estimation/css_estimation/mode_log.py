# SPDX-License-Identifier: Apache-2.0
"""Log lines about an estimator's mode, few enough to read."""

from collections.abc import Mapping

_LEAST_NS = 60_000_000_000
"""Simulated time between two lines; changes in between are counted."""


class ModeLog:
    """Says when the mode changes."""

    def __init__(self, names: Mapping[int, str], epoch_ns: int) -> None:
        self._names = names
        self._epoch_ns = epoch_ns
        self._mode: int | None = None
        self._said_ns: int | None = None
        self._unsaid = 0

    def line(self, stamp_ns: int, mode: int) -> str | None:
        """What there is to say after a cycle."""
        last, self._mode = self._mode, mode
        if last is None or last == mode:
            return None
        if self._said_ns is not None and 0 <= stamp_ns - self._said_ns < _LEAST_NS:
            self._unsaid += 1
            return None
        elapsed_s = (stamp_ns - self._epoch_ns) * 1e-9
        text = f"mode {self._name(last)} -> {self._name(mode)} at {elapsed_s:g} s"
        if self._unsaid:
            text += f", after {self._unsaid} changes that were not reported"
        self._said_ns, self._unsaid = stamp_ns, 0
        return text

    def _name(self, mode: int) -> str:
        return f"'{self._names.get(mode, str(mode))}'"
