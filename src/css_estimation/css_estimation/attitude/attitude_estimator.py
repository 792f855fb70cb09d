# SPDX-License-Identifier: Apache-2.0
"""A filter of attitude about three axes as a component of the graph; a node file names the algorithm and its inputs."""

from abc import abstractmethod
from collections.abc import Iterable, Mapping
from types import ModuleType
from typing import Any, ClassVar

from css_common.component import Component, Finding, Outgoing, Output, Received, Standing
from css_common.health_report import HealthReport, health_output
from css_common.kernel import typed_call
from css_common.mission_node import Node
from css_common.orbit_section import needed_of_orbit
from css_common.schema import Values
from css_estimation.health.cell_options import ENABLED
from css_estimation.messages import attitude_estimate_fields
from css_msgs.msg import AttitudeEstimate
from css_sensors.calibrated_readings import CalibratedReadings, temperature_findings


class AttitudeEstimator(Component):
    """Cell outputs and what else it listens to in; `<node name>/attitude` and the health of cells out.

    Class attributes:
        algorithm: module with `parameters`, `initial_state`, `initial_memory` and `step`.
    """

    algorithm: ClassVar[ModuleType]

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        attitude = Output("attitude", f"{name}/attitude", AttitudeEstimate, ends_cycle=True)
        return (attitude, health_output(name)) if values[ENABLED] else (attitude,)

    @classmethod
    def needed(cls, values: Values) -> tuple[str, ...]:
        return ("cells.normals", *needed_of_orbit(values))

    @classmethod
    def preflight(cls, node: Node, graph: Mapping[str, Node]) -> Iterable[Finding]:
        return temperature_findings(node.values, graph)

    @abstractmethod
    def aided_by(self, stamp_ns: int, received: Received) -> tuple[Any, ...]:
        """What the algorithm is given of a stamp beside the cells."""

    def configure(self) -> None:
        self._parameters = self.algorithm.parameters(self.values)
        self._state = self.algorithm.initial_state(self._parameters)
        self._memory = self.algorithm.initial_memory(self._parameters)
        self._step = typed_call(self.algorithm.step)
        self.calibrated = CalibratedReadings(self.values)
        self._last_stamp_ns: int | None = None
        self._health = HealthReport() if self.values[ENABLED] else None

    def tune(self, values: Values) -> None:
        super().tune(values)
        self._parameters = self.algorithm.parameters(values)

    def standing(self) -> Standing:
        return Standing(self.calibrated.warning)

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        since_ns = 0 if self._last_stamp_ns is None else stamp_ns - self._last_stamp_ns
        self._last_stamp_ns = stamp_ns
        cells = received["cells"]
        assert cells is not None  # a required input
        self._state, solution = self._step(
            self._parameters,
            self._state,
            self._memory,
            since_ns / 1e9,
            self.calibrated.cells(cells.voltages, received.get("temperature")),
            *self.aided_by(stamp_ns, received),
        )
        fields = attitude_estimate_fields(solution, self._memory.covariance)
        told: Outgoing = {}
        if self._health is not None:
            told = self._health.told(self, stamp_ns, self._memory.health.verdicts, self._state.cells.step)
        return {"attitude": self.message("attitude", stamp_ns, **fields), **told}
