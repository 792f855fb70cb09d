# SPDX-License-Identifier: Apache-2.0
"""What a recording is too coarse to tell of the health of sensors, in words."""

import math

import numpy as np

from css_common.declared import builder
from css_common.schema import Values
from css_estimation.health.cell_following import LONGEST_STEP
from css_estimation.health.rate_checks import LARGEST_UNKNOWN, NOISE, RateChecks, unknown_turn
from css_estimation.health.watched import ENABLED
from css_estimation.sun.sun_tracking import USE_GYRO

_WORTH_A_WORD = 0.1  # of the steps
_checks = builder(RateChecks)


def coarse_lines(values: Values, stamps_ns: np.ndarray) -> list[str]:
    """A line for each sort of sensor whose health many steps of a recording are too long to judge.

    Args:
        values: of an estimator.
        stamps_ns: (M,) of its cycles.
    """
    if ENABLED not in values or not values[ENABLED] or len(stamps_ns) < 2:
        return []
    steps_s = np.diff(stamps_ns) / 1e9
    lines = []
    alone = int(np.count_nonzero(steps_s > LONGEST_STEP))
    if alone > _WORTH_A_WORD * len(steps_s):
        lines.append(
            f"{alone} of {len(steps_s)} steps are longer than {LONGEST_STEP:g} s: how the body turned in them is not "
            "known, and each reading tells of the cells alone. Found are cells out of range, cells that others which "
            "look the same or the opposite way speak against, and dead ones; others that fail may be used"
        )
    if USE_GYRO in values and values[USE_GYRO] and NOISE in values:
        longest_s = longest_judged_step(values)
        unjudged = int(np.count_nonzero(steps_s > longest_s))
        if unjudged > _WORTH_A_WORD * len(steps_s):
            lines.append(
                f"{unjudged} of {len(steps_s)} steps are longer than {longest_s:.3g} s, in which actuators may turn "
                "the body as they like: the gyro is not held against the Sun, only its readings against each other"
            )
    return lines


def longest_judged_step(values: Values) -> float:
    """Time [s] from reading to reading of a gyro, beyond which no two of them tell how a body at rest turned."""
    unit = unknown_turn.py_func(_checks(values), 0.0, 1.0)
    return math.inf if unit == 0.0 else (LARGEST_UNKNOWN / unit) ** 0.25
