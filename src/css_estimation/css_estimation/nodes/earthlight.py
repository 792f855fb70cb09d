# SPDX-License-Identifier: Apache-2.0
"""Attitude about all three axes from cells, gyro or wheels, and the orbit; no magnetometer."""

from collections.abc import Iterable, Mapping
from types import ModuleType
from typing import ClassVar

from css_common.component import Component, Finding, Input, Outgoing, Output, Received, Standing
from css_common.health_report import HealthReport, health_output
from css_common.kernel import typed_call
from css_common.mission import Node
from css_common.run import node_main
from css_common.schema import Values
from css_common.sections import needed_of_orbit, needed_of_wheel_momentum
from css_estimation.health.cell_options import ENABLED
from css_estimation.messages import attitude_estimate_fields
from css_estimation.sun.flight_sky import flight_sky, sky_at
from css_estimation.sun.sun_estimator import aiding_of, inputs_of
from css_estimation.sun_filter import earthlight
from css_msgs.msg import AttitudeEstimate
from css_sensors.calibrated_readings import CalibratedReadings, temperature_findings


class Earthlight(Component):
    """Attitude by the Sun filter: the Sun is one direction, the light of the Earth on the cells the other."""

    algorithm: ClassVar[ModuleType] = earthlight
    shared = ("cells", "orbit", "gyro", "magnetometer", "spacecraft", "wheels")
    parameters = earthlight.PARAMETERS

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        return inputs_of(values)

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        attitude = Output("attitude", f"{name}/attitude", AttitudeEstimate, ends_cycle=True)
        return (attitude, health_output(name)) if values[ENABLED] else (attitude,)

    @classmethod
    def needed(cls, values: Values) -> tuple[str, ...]:
        return ("cells.normals", *needed_of_orbit(values), *needed_of_wheel_momentum(values))

    @classmethod
    def conflicts(cls, values: Values) -> Iterable[str]:
        return earthlight.conflicts(values)

    @classmethod
    def preflight(cls, node: Node, graph: Mapping[str, Node]) -> Iterable[Finding]:
        return temperature_findings(node.values, graph)

    def configure(self) -> None:
        self._parameters = earthlight.parameters(self.values)
        self._state = earthlight.initial_state(self._parameters)
        self._memory = earthlight.initial_memory(self._parameters)
        self._step = typed_call(earthlight.step)
        self._sky = flight_sky(self.values)
        self._calibrated = CalibratedReadings(self.values)
        self._last_stamp_ns: int | None = None
        self._health = HealthReport() if self.values[ENABLED] else None

    def tune(self, values: Values) -> None:
        super().tune(values)
        self._parameters = earthlight.parameters(values)

    def standing(self) -> Standing:
        return Standing(self._calibrated.warning)

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
            self._calibrated.cells(cells.voltages, received.get("temperature")),
            aiding_of(received, sky_at(self._sky, stamp_ns), self._calibrated),
        )
        fields = attitude_estimate_fields(solution, self._memory.covariance)
        told: Outgoing = {}
        if self._health is not None:
            told = self._health.told(self, stamp_ns, self._memory.health.verdicts, self._state.cells.step)
        return {"attitude": self.message("attitude", stamp_ns, **fields), **told}


main = node_main(Earthlight)

if __name__ == "__main__":
    raise SystemExit(main())
