# SPDX-License-Identifier: Apache-2.0
"""Failed coarse sun sensor cells, as text in a mission and as arrays in the signal chain.

One fault is a text `CELL KIND [VALUE] [from START] [to END]`: the number of the cell, what it does, and the
simulated seconds between which it does so. Kinds:

    dead            reads zero
    stuck VALUE     reads VALUE, whatever the light
    noisy SIGMA     reads right, with normal noise of standard deviation SIGMA on top
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from css_common.kernel import kernel
from css_common.random_streams import RandomKey, Stream, normal4

FORM = "CELL dead|stuck VALUE|noisy SIGMA [from START] [to END]"
DEAD, STUCK, NOISY = 0, 1, 2
_KINDS = {"dead": DEAD, "stuck": STUCK, "noisy": NOISY}
_LAST_STEP = 2**62


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
    expected = ValueError(f"{text!r} is no fault, expected CELL dead|stuck VALUE|noisy SIGMA [from START] [to END]")
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


def cell_faults(fault_texts: list[str], period_s: float) -> np.ndarray:
    """Array of FAULT, in the order given: a later one acts on what an earlier one left.

    Args:
        fault_texts: one fault each.
        period_s: control cycle [s], by which times become cycles.
    """

    def step(time_s: float) -> int:
        # a fault begins with the first cycle at or after its time; the slack is for times like 0.3 / 0.1
        return _LAST_STEP if math.isinf(time_s) else math.ceil(time_s / period_s - 1e-6)

    faults = [parse_fault(text) for text in fault_texts]
    rows = [(f.cell, f.kind, f.value, step(f.start_s), step(f.end_s)) for f in faults]
    return np.array(rows, dtype=FAULT)


def conflicts(fault_texts: list[str], cell_count: int) -> Iterator[str]:
    """What is wrong with the faults of a mission with so many cells, one message each."""
    for text in fault_texts:
        try:
            fault = parse_fault(text)
        except ValueError as error:
            yield f"faults: {error}"
        else:
            if fault.cell >= cell_count:
                yield f"faults: {text!r} given, expected a cell from 0 to {cell_count - 1}"


@kernel
def apply_faults(faults, key: RandomKey, step: int, voltages) -> None:
    """Change the outputs of the cells that have failed at this control cycle."""
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
