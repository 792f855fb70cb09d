# SPDX-License-Identifier: Apache-2.0
"""Sun-pointing control of the spacecraft with wheels and, if fitted, torque rods."""

from collections.abc import Iterable, Mapping
from typing import ClassVar

from css_common.actuator_sections import needed_of_wheels
from css_common.component import Finding
from css_common.mission_node import Node
from css_common.run import node_main
from css_common.schema import Values
from sunpoint_control import sun_pointing_control
from sunpoint_control.control_algorithm import ControlAlgorithm
from sunpoint_control.control_checks import control_findings
from sunpoint_control.controller import Controller


class MrpControl(Controller):
    """Turns the solar arrays to the estimated Sun by MRP feedback on the wheels (O'Keefe & Schaub 2013)."""

    algorithm: ClassVar[ControlAlgorithm] = sun_pointing_control
    parameters = sun_pointing_control.PARAMETERS

    @classmethod
    def needed(cls, values: Values) -> tuple[str, ...]:
        return ("spacecraft.inertia", *needed_of_wheels(values))

    @classmethod
    def preflight(cls, node: Node, graph: Mapping[str, Node]) -> Iterable[Finding]:
        return control_findings(node, graph)


main = node_main(MrpControl)
