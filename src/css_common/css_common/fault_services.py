# SPDX-License-Identifier: Apache-2.0
"""Services of a node with faulty units: they change its parameter `faults`, the one place where its faults stand."""

import math
from typing import TYPE_CHECKING, Any

from rclpy.parameter import Parameter as RosParameter

from css_common.fault_lines import FAULTS, line_of, parse_line
from css_common.schema import shaped_values, shown
from css_msgs.srv import ClearFault, InjectFault

if TYPE_CHECKING:
    from css_common.host import ComponentNode


class FaultServices:
    """`~/inject_fault` and `~/clear_fault`; what is wrong with a request is said in the answer."""

    def __init__(self, node: "ComponentNode") -> None:
        self._node = node
        node.create_service(InjectFault, "~/inject_fault", self._inject)
        node.create_service(ClearFault, "~/clear_fault", self._clear)

    def _inject(self, request: Any, response: Any) -> Any:
        try:
            line = self._line(request)
            response.message = self._set([*self._lines(), line])
            response.fault = line
        except ValueError as error:
            response.message = str(error)
        response.success = not response.message
        return response

    def _clear(self, request: Any, response: Any) -> Any:
        lines, wanted = self._lines(), request.fault.strip()
        ended = [line for line in lines if wanted in ("", line, line.split()[0])]
        if not ended and wanted:
            expected = " or ".join(map(repr, lines)) or "none, nothing fails here"
            response.message = f"fault: {shown(wanted)} given, expected {expected}"
        else:
            response.message = self._set([line for line in lines if line not in ended])
        response.success = not response.message
        response.cleared = ended if response.success else []
        return response

    def _line(self, request: Any) -> str:
        """The line of what is asked for, from the next cycle on.

        Raises:
            ValueError: it is no fault of this node.
        """
        for name in ("target", "kind"):
            word = getattr(request, name)
            if len(word.split()) != 1:
                raise ValueError(f"{name}: {shown(word)} given, expected one word")
        duration = request.duration
        if not 0.0 <= duration < math.inf:
            raise ValueError(f"duration: {duration:g} given, expected seconds, or 0 for as long as it is not cleared")
        start_s = self._node.next_cycle_ns() / 1e9
        times = {"from": start_s} | ({"to": start_s + duration} if duration else {})
        line = line_of(request.target, request.kind, request.values, times)
        component = self._node.component_type
        values = shaped_values(component.table(), self._node.canonical)
        parse_line(line, component.fault_kinds, component.fault_units(values))
        return line

    def _lines(self) -> list[str]:
        return list(self._node.canonical[FAULTS.name])

    def _set(self, lines: list[str]) -> str:
        """Why the parameter cannot have these lines; empty when it has."""
        value = RosParameter(FAULTS.name, RosParameter.Type.STRING_ARRAY, lines)
        (result,) = self._node.set_parameters([value])
        return result.reason if not result.successful else ""
