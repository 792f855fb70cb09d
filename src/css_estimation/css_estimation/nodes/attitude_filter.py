# SPDX-License-Identifier: Apache-2.0
"""Attitude and gyro bias from cells, magnetometer and gyro."""

from collections.abc import Iterable, Mapping
from types import ModuleType
from typing import ClassVar

from css_common.component import Component, Finding, Input, Outgoing, Output, Received, Standing
from css_common.declared import merged
from css_common.health_report import HealthReport, health_output
from css_common.kernel import typed_call
from css_common.mission import Node
from css_common.run import node_main
from css_common.schema import Values
from css_common.sections import needed_of_orbit
from css_common.sensor_inputs import field_input, gyro_input
from css_estimation.attitude import attitude_ekf, attitude_options, flight_references
from css_estimation.attitude.flight_references import FlightReferences
from css_estimation.health.cell_options import ENABLED
from css_estimation.messages import attitude_estimate_fields, cells_input
from css_msgs.msg import AttitudeEstimate
from css_sensors.calibrated_readings import CalibratedReadings, temperature_findings, temperature_inputs


class AttitudeFilter(Component):
    """Attitude and gyro bias by a multiplicative Kalman filter; the Sun as a vector or as voltages (DiGregorio)."""

    algorithm: ClassVar[ModuleType] = attitude_ekf
    shared = ("cells", "orbit", "gyro", "magnetometer")
    parameters = merged(attitude_options.PARAMETERS, flight_references.PARAMETERS)

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        return (
            cells_input(values),
            *temperature_inputs(values),
            gyro_input(values),
            field_input(values),
        )

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        attitude = Output("attitude", f"{name}/attitude", AttitudeEstimate, ends_cycle=True)
        return (attitude, health_output(name)) if values[ENABLED] else (attitude,)

    @classmethod
    def needed(cls, values: Values) -> tuple[str, ...]:
        return ("cells.normals", *needed_of_orbit(values))

    @classmethod
    def conflicts(cls, values: Values) -> Iterable[str]:
        if values.calibration.mode != "off" and values.sun_model == "vector":
            yield f"calibration.mode: {values.calibration.mode} given, but sun_model vector calibrates no cells"

    @classmethod
    def preflight(cls, node: Node, graph: Mapping[str, Node]) -> Iterable[Finding]:
        return temperature_findings(node.values, graph)

    def configure(self) -> None:
        self._parameters = self.algorithm.parameters(self.values)
        self._state = self.algorithm.initial_state(self._parameters)
        self._memory = self.algorithm.initial_memory(self._parameters)
        self._step = typed_call(self.algorithm.step)
        self._references = FlightReferences(self.values)
        self._calibrated = CalibratedReadings(self.values)
        self._last_stamp_ns: int | None = None
        self._health = HealthReport() if self.values[ENABLED] else None

    def tune(self, values: Values) -> None:
        super().tune(values)
        self._parameters = self.algorithm.parameters(values)

    def standing(self) -> Standing:
        return Standing(self._calibrated.warning)

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        since_ns = 0 if self._last_stamp_ns is None else stamp_ns - self._last_stamp_ns
        self._last_stamp_ns = stamp_ns
        cells = received["cells"]
        assert cells is not None  # a required input
        gyro_b, gyro_valid = self._calibrated.rate(received["gyro"])
        field_b, field_valid = self._calibrated.field(received["field"])
        self._state, solution = self._step(
            self._parameters,
            self._state,
            self._memory,
            since_ns / 1e9,
            self._calibrated.cells(cells.voltages, received.get("temperature")),
            gyro_b,
            gyro_valid,
            field_b,
            field_valid,
            self._references.at((stamp_ns - self.epoch_ns) * 1e-9),
            self._references.light,
        )
        fields = attitude_estimate_fields(solution, self._memory.covariance)
        told: Outgoing = {}
        if self._health is not None:
            told = self._health.told(self, stamp_ns, self._memory.health.verdicts, self._state.cells.step)
        return {"attitude": self.message("attitude", stamp_ns, **fields), **told}


main = node_main(AttitudeFilter)

if __name__ == "__main__":
    raise SystemExit(main())
