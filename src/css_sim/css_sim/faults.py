# SPDX-License-Identifier: Apache-2.0
"""The faults of a case of simulated sensors and actuators, as arrays for kernels."""

import math
from collections.abc import Collection, Sequence

import numpy as np

from css_common.case_faults import CaseFault, CaseFaults, Seed
from css_common.fault_lines import FaultKind, Units
from css_common.random_streams import RandomKey
from css_sim import fault_effects as effects
from css_sim.fault_effects import FAULT
from css_sim.fault_kinds import SORTS


def of_case(kinds: Sequence[FaultKind], units: Units, key: RandomKey, period: float) -> CaseFaults:
    """The faults of one case, by the lines that there are.

    Args:
        period: control cycle [s].
    """
    return CaseFaults(kinds, units, SORTS, key, period, _drawn)


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
    table["index"] = [(fault.sort << 16) + place for place, fault in enumerate(faults)]
    for name in ("sort", "unit", "kind", "first_step", "end_step"):
        table[name] = [getattr(fault, name) for fault in faults]
    for k, name in enumerate(("value", "second")):
        table[name] = [fault.scaled[k] if k < len(fault.scaled) else 0.0 for fault in faults]
    table["held"] = math.nan
    return table


def with_held(table: np.ndarray, before: np.ndarray, anew: Collection[int] = ()) -> np.ndarray:
    """Faults (F,) of FAULT, the frozen ones among them with what they held `before` if they were there.

    Args:
        anew: sorts of units that know nothing of before.
    """
    holding = before[~np.isnan(before["held"])]
    known = {_identity(row): row["held"] for row in holding if row["sort"] not in anew}
    table["held"] = math.nan
    for row in table if known else ():  # as nearly always none
        row["held"] = known.get(_identity(row), math.nan)
    return table


def _identity(row: np.void) -> tuple[int, ...]:
    return tuple(int(row[name]) for name in ("sort", "unit", "kind", "first_step", "end_step"))
