# SPDX-License-Identifier: Apache-2.0
"""Which cells see the Sun, judged by their outputs.

Light reflected by the Earth gives a cell up to a quarter of the direct Sun (half of it on polar orbits): without
a gate such cells drag a heading by tens of degrees. A gate relative to the brightest cell leaves a scale that is
common to all cells without effect; an absolute gate does not.
"""

from typing import NamedTuple

from css_common.declared import given, made
from css_common.kernel import kernel
from css_common.schema import choice, real
from css_estimation.sun.cell_layout import READABLE

CELL_SIGMA = real(
    "cell_sigma", 0.1, "-", "cell error, all causes, 1 sigma", low=0.0, open_low=True, high=10.0, tunable=True
)
"""Parameter of estimators whose covariance follows from the cells' errors."""


class Gate(NamedTuple):
    """Which cells see the Sun."""

    relative: bool = made(
        lambda word: word == "relative",
        choice(
            "gate_kind", "relative", ("relative", "absolute"), "gate as a share of the brightest cell, or as an output"
        ),
    )
    level: float = given(real("gate", 0.45, "-", "a cell above the gate sees the Sun", low=0.0, high=1.0, tunable=True))
    minimum_output: float = given(
        real("minimum_output", 0.1, "-", "no Sun unless a cell is above it", low=0.0, high=1.0, tunable=True)
    )


@kernel
def lit_cells(gate: Gate, voltages, top: int) -> tuple[bool, int]:
    """Whether there is a Sun, and the mask of the cells that see it: none if all are below an absolute gate.

    Args:
        voltages: (N,) cell outputs [-]; values that are not finite count as dark.
        top: result of `brightest`.
    """
    mask = 0
    if top < 0 or voltages[top] <= gate.minimum_output:
        return False, mask
    level = gate.level * voltages[top] if gate.relative else gate.level
    for i in range(voltages.shape[0]):
        if voltages[i] > level and voltages[i] < READABLE:
            mask |= 1 << i
    return True, mask
