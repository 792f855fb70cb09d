# SPDX-License-Identifier: Apache-2.0
"""Failed coarse sun sensor cells of one case: those of the node's lines, and so many different ones that are drawn."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from css_common.case_faults import NEVER, CaseFault, CaseFaults, step_of
from css_common.declared import builder, given, part, table_of
from css_common.fault_lines import FAULTS, Units
from css_common.kernel import kernel
from css_common.mission_section import PERIOD
from css_common.random_streams import RandomKey, Stream, uniform4
from css_common.schema import Values, choice, integer, real
from css_sensors.cells import NORMALS
from css_sim import faults
from css_sim.fault_effects import CELL, DEAD, SHADOWED, STUCK, acts
from css_sim.fault_kinds import kinds_of

KINDS = kinds_of("cell")

# Draws of a case's failures, apart from those in flight, whose index is the place of the fault.
_FAILURES = 2**31


class RandomFaults(NamedTuple):
    """Failures that are drawn for each case."""

    cells: int = given(
        integer("random_faults.count", 0, "-", "so many different cells, drawn for each case, fail", low=0, high=32)
    )
    kind: str = given(
        choice("random_faults.kind", "dead", ("dead", "stuck", "mixed"), "how they fail; mixed: either, equally likely")
    )
    value: float = given(
        real(
            "random_faults.value", -1.0, "-", "output of stuck ones; below 0: uniform from 0 to 1", low=-1.0, high=10.0
        )
    )
    time: float = given(real("random_faults.time", 0.0, "s", "when they fail", low=0.0, high=1e9))


class CellFaults(NamedTuple):
    """All failures of a mission."""

    faults: list[str] = given(FAULTS)
    random: RandomFaults = part(RandomFaults)


PARAMETERS = table_of(CellFaults)
parameters = builder(CellFaults)


def units(values: Values) -> Units:
    """The cells that may fail."""
    return {"cell": [str(i) for i in range(len(values[NORMALS]))]}


def drawn_faults(p: RandomFaults, cells: int, key: RandomKey, period: float) -> list[CaseFault]:
    """Faults of `p.cells` different ones of so many cells, each set of them equally likely, at most one for each cell.

    A case with more failures has those of the case with fewer among them.
    """
    healthy = list(range(cells))
    first = step_of(p.time, period)
    failed = []
    for k in range(min(p.cells, len(healthy))):
        which, kind, value, _ = uniform4(key, Stream.CELL_FAILURE, 0, _FAILURES + k)
        cell = healthy.pop(int(which * len(healthy)))
        if p.kind == "dead" or (p.kind == "mixed" and kind < 0.5):
            failed.append(CaseFault(CELL, cell, DEAD, (), (), first, NEVER))
        else:
            level = (p.value if p.value >= 0.0 else value,)
            failed.append(CaseFault(CELL, cell, STUCK, level, level, first, NEVER))
    return failed


def of_case(values: Values, key: RandomKey) -> CaseFaults:
    """The failures of one case, by the lines that there are."""
    return faults.of_case(KINDS, units(values), key, values[PERIOD])


def case_faults(values: Values, key: RandomKey, known: CaseFaults | None = None) -> list[CaseFault]:
    """Failures of one case: those of the lines, then those drawn. There are as many of them in all cases.

    A later one acts on what an earlier one left.

    Args:
        values: checked ones (`PARAMETERS`, the mission and its cells).
        known: of the case, where lines come one by one.
    """
    p = parameters(values)
    scripted = (known or of_case(values, key)).of(p.faults)
    return scripted + drawn_faults(p.random, len(values[NORMALS]), key, values[PERIOD])


def conflicts(values: Values) -> Iterator[str]:
    """What is wrong between the values, one message each."""
    p, cell_count = parameters(values), len(values[NORMALS])
    if p.random.cells > cell_count:
        yield f"random_faults.count: {p.random.cells} given, expected at most the number of cells, {cell_count}"


@kernel
def light_left(failed: np.ndarray, step: int, cell: int) -> float:
    """Share of the light that faults (F,) let a cell have."""
    share = 1.0
    for k in range(failed.shape[0]):
        fault = failed[k]
        if fault.kind == SHADOWED and fault.unit == cell and acts(fault, step):
            share *= 1.0 - fault.value
    return share
