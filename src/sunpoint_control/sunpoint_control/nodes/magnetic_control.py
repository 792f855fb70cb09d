# SPDX-License-Identifier: Apache-2.0
"""Detumbling and Sun-pointing spin of a spacecraft that has torque rods and no wheels."""

from collections.abc import Iterable, Mapping
from typing import ClassVar

from css_common.component import Finding
from css_common.mission_node import Node
from css_common.run import node_main
from css_common.schema import Values
from sunpoint_control import magnetic_control
from sunpoint_control.control_algorithm import ControlAlgorithm
from sunpoint_control.controller import Controller
from sunpoint_control.magnetic_checks import magnetic_findings


class MagneticControl(Controller):
    """Detumbles with torque rods (Avanzini & Giulietti 2012), then spins about the Sun line; no gyro, no wheels."""

    shared: ClassVar[tuple[str, ...]] = (*Controller.shared, "orbit")
    algorithm: ClassVar[ControlAlgorithm] = magnetic_control
    needs_sun: ClassVar[bool] = False  # a spacecraft without Sun estimate shall be detumbled nevertheless
    turns_wheels: ClassVar[bool] = False
    parameters = magnetic_control.PARAMETERS

    @classmethod
    def needed(cls, values: Values) -> tuple[str, ...]:
        return ("spacecraft.inertia",)

    @classmethod
    def preflight(cls, node: Node, graph: Mapping[str, Node]) -> Iterable[Finding]:
        return magnetic_findings(node, graph)


main = node_main(MagneticControl)
