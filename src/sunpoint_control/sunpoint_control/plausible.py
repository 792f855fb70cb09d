# SPDX-License-Identifier: Apache-2.0
"""Which numbers are measurements: beyond these, and where they are none, an input is a fault."""

from css_common.kernel import kernel

LARGEST_DIRECTION = 2.0  # of a unit vector
LARGEST_RATE = 100.0  # [rad/s]
LARGEST_FIELD = 1.0  # [T]


@kernel
def within(values, limit: float) -> bool:
    """Whether all values are numbers of at most a size."""
    # a NaN compares false
    for value in values:  # noqa: SIM110  (a generator expression does not compile)
        if not abs(value) <= limit:
            return False
    return True
