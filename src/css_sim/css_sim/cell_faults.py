# SPDX-License-Identifier: Apache-2.0
"""Failed coarse sun sensor cells, as text in a mission and as arrays in the signal chain.

One fault is a text `CELL KIND [VALUE] [from START] [to END]`: the number of the cell, what it does, and the
simulated seconds between which it does so. Kinds:

    dead            reads zero
    stuck VALUE     reads VALUE, whatever the light
    noisy SIGMA     reads right, with normal noise of standard deviation SIGMA on top

Failures can be drawn too, so many for each case of a study: which cells, dead or stuck, and at which output.
"""

import dataclasses
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from css_common.declared import builder, given, part, table_of
from css_common.kernel import kernel
from css_common.random_streams import RandomKey, Stream, normal4, uniform4
from css_common.schema import Values, choice, integer, real, texts
from css_common.sections import PERIOD
from css_sensors.cells import NORMALS

FORM = "CELL dead|stuck VALUE|noisy SIGMA [from START] [to END]"
DEAD, STUCK, NOISY = 0, 1, 2
_KINDS = {"dead": DEAD, "stuck": STUCK, "noisy": NOISY}
_LAST_STEP = 2**62

# Draws of a case's failures, apart from those of noisy cells, whose index is the place of the fault.
_FAILURES = 2**31

FAULT = np.dtype(
    [
        ("cell", np.int64),
        ("kind", np.int64),  # DEAD, STUCK or NOISY
        ("value", np.float64),  # output held, or standard deviation [-]
        ("first_step", np.int64),  # first control cycle of the fault
        ("end_step", np.int64),  # first control cycle after it
    ],
    align=True,
)

NO_FAULTS = np.zeros(0, FAULT)


class Fault(NamedTuple):
    """One fault; times in seconds after the epoch, `end_s` infinite when it stays."""

    cell: int
    kind: int
    value: float
    start_s: float
    end_s: float


def parse_fault(text: str) -> Fault:
    """One fault of its text.

    Raises:
        ValueError: the text has another form.
    """
    expected = ValueError(f"{text!r} is no fault, expected {FORM}")
    words = text.split()
    if len(words) < 2 or not words[0].isdecimal() or words[1] not in _KINDS:
        raise expected
    cell, kind = int(words[0]), _KINDS[words[1]]
    rest = words[2:]
    try:
        value = 0.0 if kind == DEAD else float(rest.pop(0))
        start_s = float(rest.pop(0)) if rest[:1] == ["from"] and rest.pop(0) else 0.0
        end_s = float(rest.pop(0)) if rest[:1] == ["to"] and rest.pop(0) else math.inf
    except (IndexError, ValueError) as error:
        raise expected from error
    sensible = math.isfinite(value) and math.isfinite(start_s) and start_s < end_s
    if rest or not sensible or (kind == NOISY and value < 0.0):
        raise expected
    return Fault(cell, kind, value, start_s, end_s)


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

    faults: list[str] = given(
        dataclasses.replace(texts("faults", (), f"failed cells, each {FORM}; times in s"), tunable=True)
    )
    random: RandomFaults = part(RandomFaults)


PARAMETERS = table_of(CellFaults)
parameters = builder(CellFaults)


def drawn_faults(p: RandomFaults, cells: int, key: RandomKey) -> list[Fault]:
    """Faults of `p.cells` different ones of so many cells, each set of them equally likely, at most one for each cell.

    A case with more failures has those of the case with fewer among them.
    """
    healthy = list(range(cells))
    faults = []
    for k in range(min(p.cells, len(healthy))):
        which, kind, value, _ = uniform4(key, Stream.CELL_FAILURE, 0, _FAILURES + k)
        cell = healthy.pop(int(which * len(healthy)))
        if p.kind == "dead" or (p.kind == "mixed" and kind < 0.5):
            faults.append(Fault(cell, DEAD, 0.0, p.time, math.inf))
        else:
            faults.append(Fault(cell, STUCK, p.value if p.value >= 0.0 else value, p.time, math.inf))
    return faults


def case_faults(values: Values, key: RandomKey) -> np.ndarray:
    """Array (F,) of FAULT of one case: the faults of the mission, then those drawn. F is the same for all cases.

    A later fault acts on what an earlier one left.

    Args:
        values: checked ones (`PARAMETERS`, the mission and its cells).

    Raises:
        ValueError: a fault's text has another form.
    """
    p, period = parameters(values), values[PERIOD]

    def step(time_s: float) -> int:
        # a fault begins with the first cycle at or after its time; the slack is for times like 0.3 / 0.1
        return _LAST_STEP if math.isinf(time_s) else math.ceil(time_s / period - 1e-6)

    faults = [parse_fault(text) for text in p.faults] + drawn_faults(p.random, len(values[NORMALS]), key)
    rows = [(f.cell, f.kind, f.value, step(f.start_s), step(f.end_s)) for f in faults]
    return np.array(rows, dtype=FAULT)


def conflicts(values: Values) -> Iterator[str]:
    """What is wrong between the values, one message each."""
    p, cell_count = parameters(values), len(values[NORMALS])
    if p.random.cells > cell_count:
        yield f"random_faults.count: {p.random.cells} given, expected at most the number of cells, {cell_count}"
    for text in p.faults:
        try:
            fault = parse_fault(text)
        except ValueError as error:
            yield f"faults: {error}"
        else:
            if fault.cell >= cell_count:
                yield f"faults: {text!r} given, expected a cell from 0 to {cell_count - 1}"


@kernel
def apply_faults(faults, key: RandomKey, step: int, voltages) -> None:
    """Change the outputs of the cells that have failed at this control cycle.

    Args:
        faults: (F,) of FAULT.
        voltages: (N,) outputs [-], changed.
    """
    for k in range(faults.shape[0]):
        fault = faults[k]
        i = fault.cell
        if i >= voltages.shape[0] or step < fault.first_step or step >= fault.end_step:
            continue
        if fault.kind == DEAD:
            voltages[i] = 0.0
        elif fault.kind == STUCK:
            voltages[i] = fault.value
        else:
            voltages[i] += fault.value * normal4(key, Stream.CELL_FAILURE, step, k)[0]
