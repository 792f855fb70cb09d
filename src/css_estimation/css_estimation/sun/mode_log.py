# SPDX-License-Identifier: Apache-2.0
"""Log lines about an estimator's mode, few enough to read."""

from collections.abc import Mapping

_LEAST_NS = 60_000_000_000
"""Simulated time between two lines. What has changed in between is said when it is over."""


class ModeLog:
    """Says when the mode has changed."""

    def __init__(self, names: Mapping[int, str], epoch_ns: int) -> None:
        self._names = names
        self._epoch_ns = epoch_ns
        self._mode: int | None = None
        self._said: int | None = None
        self._said_ns: int | None = None
        self._changed_ns = 0
        self._changes = 0

    def line(self, stamp_ns: int, mode: int) -> str | None:
        """What there is to say after a cycle."""
        if mode != self._mode:
            if self._mode is None:
                self._said = mode
            else:
                self._changes += 1
            self._mode, self._changed_ns = mode, stamp_ns
        if mode == self._said or (self._said_ns is not None and 0 <= stamp_ns - self._said_ns < _LEAST_NS):
            return None
        elapsed_s = (self._changed_ns - self._epoch_ns) * 1e-9
        text = f"mode {self._name(self._said)} -> {self._name(mode)} at {elapsed_s:g} s"
        if self._changes > 1:
            text += f", after {self._changes - 1} other changes"
        self._said, self._said_ns, self._changes = mode, stamp_ns, 0
        return text

    def _name(self, mode: int | None) -> str:
        return f"'{mode if mode is None else self._names.get(mode, mode)}'"
