# SPDX-License-Identifier: Apache-2.0
"""Which units an algorithm holds for failed and why, as its kernels keep it; `health_report` tells it.

An algorithm has one row of `VERDICT` for each unit that it judges, in its memory, and changes it only with `hold`,
`rename` and `release`: rows that are the same bytes are the same verdicts.
"""

from typing import NamedTuple

import numpy as np

from css_common.kernel import kernel

SORT_CELL, SORT_GYRO, SORT_MAGNETOMETER, SORT_WHEEL, SORT_ROD, SORT_TACHOMETER = range(6)

KIND_DEAD, KIND_STUCK, KIND_NOISY, KIND_DRIFTING, KIND_SCALED, KIND_BIAS, KIND_SIGN, KIND_SATURATED = range(8)
KIND_FROZEN, KIND_SPIKES, KIND_INTERMITTENT, KIND_STUCK_LOW, KIND_STUCK_HIGH, KIND_WRAP, KIND_SWAPPED = range(8, 15)
KIND_SHADOWED, KIND_SILENT, KIND_FRICTION = range(15, 18)
KIND_SLOW = 19
KIND_UNKNOWN = 255

EVIDENCE_RANGE, EVIDENCE_STUCK, EVIDENCE_DEAD, EVIDENCE_NOISE, EVIDENCE_OPPOSITE, EVIDENCE_VOTE = range(6)
EVIDENCE_RESIDUAL, EVIDENCE_DRIFT, EVIDENCE_DARK, EVIDENCE_COMMON, EVIDENCE_SUN, EVIDENCE_FIELD = range(6, 12)
EVIDENCE_MOMENTUM, EVIDENCE_RESPONSE = 12, 13
"""The numbers of css_msgs/Faults and css_msgs/Health."""


class Verdict(NamedTuple):
    """One unit that is held for failed."""

    sort: int
    unit: int
    kind: int
    evidence: int
    statistic: float  # of that evidence, when it was first beyond its threshold for long enough
    threshold: float
    since_step: int  # when it was first beyond it, in cycles as the algorithm counts them


VERDICT = np.dtype(
    [
        *((name, np.int64) for name in ("sort", "unit", "kind", "evidence")),
        ("statistic", np.float64),
        ("threshold", np.float64),
        ("since_step", np.int64),
        ("held", np.int64),  # 0: all else says nothing
    ],
    align=True,
)
"""What is thought of one unit: a `Verdict`, and whether there is one."""


def new_verdicts(sort: int, count: int) -> np.ndarray:
    """Rows (count,) of `VERDICT` for the units of a sort, none of them held for failed."""
    rows = np.zeros(count, VERDICT)
    rows["sort"], rows["unit"] = sort, np.arange(count)
    return rows


@kernel
def hold(row, kind: int, evidence: int, statistic: float, threshold: float, since_step: int) -> None:
    """Holds the unit of a row of `VERDICT` for failed; arguments as of `Verdict`."""
    row.kind, row.evidence = kind, evidence
    row.statistic, row.threshold = statistic, threshold
    row.since_step, row.held = since_step, 1


@kernel
def rename(row, kind: int) -> None:
    """Takes the unit of a row, which is held for failed, for one that fails in another way."""
    row.kind = kind


@kernel
def release(row) -> None:
    """Uses the unit of a row again."""
    row.kind = row.evidence = row.since_step = row.held = 0
    row.statistic = row.threshold = 0.0


@kernel
def held_mask(rows) -> int:
    """Mask of the rows (N,) that are held for failed."""
    mask = 0
    for i in range(rows.shape[0]):
        if rows[i].held != 0:
            mask |= 1 << i
    return mask


def verdicts_of(rows: np.ndarray) -> list[Verdict]:
    """The verdicts in rows (N,) of `VERDICT`."""
    names = list(Verdict._fields)
    return [Verdict(*row) for row in rows[rows["held"] != 0][names].tolist()]
