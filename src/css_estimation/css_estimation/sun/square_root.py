# SPDX-License-Identifier: Apache-2.0
"""Lower triangular roots L of covariances L L^T, in arrays that are written in place."""

import math

from css_common.kernel import kernel


@kernel
def set_diagonal(root, variances) -> None:
    """The root of a diagonal covariance.

    Args:
        root: (n, n).
        variances: (n,) or a tuple of n.
    """
    root[:, :] = 0.0
    # their number, which the compiler knows of a tuple: else an index out of range is a way to an exception
    for i in range(len(variances)):
        root[i, i] = math.sqrt(variances[i])


@kernel
def add_vector(root, size: int, v) -> None:
    """L L^T + v v^T by rotations (Golub & Van Loan, section 6.5.4); zeros on the diagonal are allowed.

    Args:
        root: (>= size, >= size), of which the first rows and columns are meant.
        v: (>= size,), spent.
    """
    for k in range(size):
        if root[k, k] == 0.0 and v[k] == 0.0:
            continue
        # the length by IEEE 754's own operations: of `hypot` C libraries give different last bits
        largest = max(abs(root[k, k]), abs(v[k]))
        x, y = root[k, k] / largest, v[k] / largest
        r = largest * math.sqrt(x * x + y * y)
        c, s = root[k, k] / r, v[k] / r
        root[k, k] = r
        for i in range(k + 1, size):
            old = root[i, k]
            root[i, k] = c * old + s * v[i]
            v[i] = c * v[i] - s * old


@kernel
def take_vector(root, size: int, v) -> bool:
    """L L^T - v v^T by hyperbolic rotations (same section); False, with the root spoilt, when that is no covariance.

    Args:
        root, size, v: as of `add_vector`.
    """
    for k in range(size):
        left = (root[k, k] - v[k]) * (root[k, k] + v[k])
        # a NaN compares false
        if not left > 0.0:
            if left == 0.0 and v[k] == 0.0:
                continue
            return False
        r = math.sqrt(left)
        c, s = r / root[k, k], v[k] / root[k, k]
        root[k, k] = r
        for i in range(k + 1, size):
            root[i, k] = (root[i, k] - s * v[i]) / c
            v[i] = c * v[i] - s * root[i, k]
    return True


@kernel
def solve_lower(root, size: int, b) -> None:
    """Writes L^-1 b in the place of b, (>= size,)."""
    for k in range(size):
        total = b[k]
        for j in range(k):
            total -= root[k, j] * b[j]
        b[k] = total / root[k, k]
