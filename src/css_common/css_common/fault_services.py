# SPDX-License-Identifier: Apache-2.0
"""Services for the faults of a node: they change its parameters `faults` and `io.faults`, where all of them stand."""

import math
from typing import TYPE_CHECKING, Any

from rclpy.parameter import Parameter as RosParameter

from css_common import link_kinds
from css_common.fault_lines import FAULTS, Host, line_of, parse_line
from css_common.link_kinds import LINK_FAULTS
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
            name = link_kinds.parameter_of(line.partition(".")[0].split()[0], FAULTS).name
            response.message = self._set({name: [*self._lines(name), line]})
            response.fault = line
        except ValueError as error:
            response.message = str(error)
        response.success = not response.message
        return response

    def _clear(self, request: Any, response: Any) -> Any:
        given = {name: self._lines(name) for name in self._names}
        lines, wanted = [line for of_one in given.values() for line in of_one], request.fault.strip()
        ended = [line for line in lines if wanted in ("", line, line.split()[0])]
        if not ended and wanted:
            expected = " or ".join(map(repr, lines)) or "none, nothing fails here"
            response.message = f"fault: {shown(wanted)} given, expected {expected}"
        else:
            kept = {name: [line for line in of_one if line not in ended] for name, of_one in given.items()}
            response.message = self._set({name: left for name, left in kept.items() if left != given[name]})
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
        parse_line(line, *self._may_fail(request.target))
        return line

    def _may_fail(self, target: str) -> Host:
        """What may fail of the node: with its own units, or in a message, by its clock or as a process."""
        component = self._node.component_type
        values = shaped_values(component.table(), self._node.canonical)
        if target.partition(".")[0] in link_kinds.SORTS or not component.fault_kinds:
            return Host(link_kinds.KINDS, component.link_units(self._node.get_name(), values))
        return Host(component.fault_kinds, component.fault_units(values))

    @property
    def _names(self) -> tuple[str, ...]:
        return (*((FAULTS.name,) if self._node.component_type.fault_kinds else ()), LINK_FAULTS.name)

    def _lines(self, name: str) -> list[str]:
        return list(self._node.canonical[name])

    def _set(self, lines: dict[str, list[str]]) -> str:
        """Why the parameters cannot have these lines; empty when they have."""
        for name, of_one in lines.items():
            (result,) = self._node.set_parameters([RosParameter(name, RosParameter.Type.STRING_ARRAY, of_one)])
            if not result.successful:
                return str(result.reason)
        return ""
