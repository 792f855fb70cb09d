# SPDX-License-Identifier: Apache-2.0
"""What a node with faulty units has besides: its faults as kernels take them, and a topic that tells which act."""

from collections.abc import Sequence

from css_common.case_faults import CaseFault, Teller
from css_common.codec import Sample
from css_common.component import Component, Output
from css_common.fault_lines import FAULTS
from css_common.schema import Table, Values, flag
from css_msgs.msg import Faults
from css_sim.fault_effects import NO_FAULTS
from css_sim.faults import rows, with_held

REPORT = flag("report_faults", False, "tell which faults act even if none is given before the flight")
PARAMETERS: Table = (FAULTS, REPORT)

_KEY = "faults"


def fault_outputs(name: str, values: Values, drawn: bool = False) -> tuple[Output, ...]:
    """The topic on which a node tells its faults; none where none are given, or `drawn` besides."""
    told = bool(values[FAULTS]) or values[REPORT] or drawn
    return (Output(_KEY, f"faults/{name}", Faults, events=True),) if told else ()


class Failing:
    """The faults of a node.

    Attributes:
        table: (F,) of `fault_effects.FAULT`.
    """

    def __init__(self, faults: Sequence[CaseFault], before: "Failing | None" = None) -> None:
        """Faults from the first step on, or for a node that begins anew after those that it told `before`."""
        self._faults: Sequence[CaseFault] = ()
        self._teller: Teller = Teller(before._teller if before is not None else None)
        self.table = NO_FAULTS
        self.take(faults)

    def take(self, faults: Sequence[CaseFault]) -> None:
        """Has other faults from now on; a frozen unit that stays frozen stays where it is."""
        if faults == self._faults:  # another parameter was set
            return
        self._faults = faults
        self.table = with_held(rows(faults), self.table)

    def told(self, component: Component, stamp_ns: int) -> dict[str, Sample]:
        """A message of the faults that act at a stamp, if they are others than those of the last message."""
        return self._teller.told(component, _KEY, stamp_ns, self._faults)
