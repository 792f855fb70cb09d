# SPDX-License-Identifier: Apache-2.0
"""Latencies as they are measured, with their percentiles over the last thousand."""

from collections import deque

import numpy as np

_KEPT = 1000


class LatencyRecord:
    """Latencies of one way."""

    def __init__(self) -> None:
        self._last: deque[int] = deque(maxlen=_KEPT)
        self._largest = 0

    def note(self, latency_ns: int) -> None:
        """Takes one [ns]."""
        self._last.append(latency_ns)
        self._largest = max(self._largest, latency_ns)

    def figures(self, name: str) -> dict[str, float]:
        """Median, 99th percentile (of the last thousand) and largest of all [ms], to the microsecond."""
        if not self._last:
            return {}
        median, high = np.percentile(self._last, (50.0, 99.0))
        named = {"p50": median, "p99": high, "max": float(self._largest)}
        return {f"{name}_ms_{key}": round(float(value) * 1e-6, 3) for key, value in named.items()}
