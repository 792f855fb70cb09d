# SPDX-License-Identifier: Apache-2.0
"""The faults of a case of simulated sensors and actuators, as arrays for kernels."""

import math
from collections.abc import Collection, Sequence

import numpy as np

from css_common import case_faults as of_lines
from css_common.case_faults import CaseFault, Seed
from css_common.fault_lines import FaultKind, Units
from css_common.random_streams import RandomKey
from css_sim import fault_effects as effects
from css_sim.fault_effects import FAULT
from css_sim.fault_kinds import SORTS


def case_faults(
    lines: list[str], kinds: Sequence[FaultKind], units: Units, key: RandomKey, period: float
) -> list[CaseFault]:
    """Faults of one case, in the order of their lines; as many for all cases, some of which may never act.

    Args:
        lines: checked ones.
        period: control cycle [s].
    """
    return of_lines.case_faults(lines, kinds, units, SORTS, key, period, _drawn)


def _drawn(fault: CaseFault, seed: Seed) -> CaseFault:
    """A fault whose level is drawn, with its level."""
    if fault.kind != effects.STUCK_RANDOM:
        return fault
    lowest, highest = fault.values
    level = (lowest + seed.draws(1 + fault.unit)[0] * (highest - lowest),)
    return fault._replace(kind=effects.STUCK, values=level, scaled=level)


def rows(faults: Sequence[CaseFault]) -> np.ndarray:
    """Array (F,) of FAULT of the faults of one node, whose draws hang on their places among them."""
    table = np.zeros(len(faults), FAULT)
    for place, (row, fault) in enumerate(zip(table, faults, strict=True)):
        row["index"] = (fault.sort << 16) + place
        row["sort"], row["unit"], row["kind"] = fault.sort, fault.unit, fault.kind
        row["value"], row["second"] = (*fault.scaled, 0.0, 0.0)[:2]
        row["first_step"], row["end_step"] = fault.first_step, fault.end_step
        row["held"] = math.nan
    return table


def with_held(table: np.ndarray, before: np.ndarray, anew: Collection[int] = ()) -> np.ndarray:
    """Faults (F,) of FAULT, the frozen ones among them with what they held `before` if they were there.

    Args:
        anew: sorts of units that know nothing of before.
    """
    known = {_identity(row): row["held"] for row in before if row["sort"] not in anew}
    for row in table:
        row["held"] = known.get(_identity(row), math.nan)
    return table


def _identity(row: np.void) -> tuple[int, ...]:
    return tuple(int(row[name]) for name in ("sort", "unit", "kind", "first_step", "end_step"))
