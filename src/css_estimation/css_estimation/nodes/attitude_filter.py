# SPDX-License-Identifier: Apache-2.0
"""Attitude and gyro bias from cells, magnetometer and gyro."""

from collections.abc import Iterable
from types import ModuleType
from typing import Any, ClassVar

from css_common.component import Input, Received
from css_common.declared import merged
from css_common.run import node_main
from css_common.schema import Values
from css_common.sensor_inputs import field_input, gyro_input
from css_estimation.attitude import attitude_ekf, attitude_options, flight_references
from css_estimation.attitude.attitude_estimator import AttitudeEstimator
from css_estimation.attitude.flight_references import FlightReferences
from css_estimation.messages import cells_input
from css_sensors.calibrated_readings import temperature_inputs


class AttitudeFilter(AttitudeEstimator):
    """Attitude and gyro bias by a multiplicative Kalman filter; the Sun as a vector or as voltages (DiGregorio)."""

    algorithm: ClassVar[ModuleType] = attitude_ekf
    shared = ("cells", "orbit", "gyro", "magnetometer")
    parameters = merged(attitude_options.PARAMETERS, flight_references.PARAMETERS)

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        return (cells_input(values), *temperature_inputs(values), gyro_input(values), field_input(values))

    @classmethod
    def conflicts(cls, values: Values) -> Iterable[str]:
        if values.calibration.mode != "off" and values.sun_model == "vector":
            yield f"calibration.mode: {values.calibration.mode} given, but sun_model vector calibrates no cells"

    def configure(self) -> None:
        super().configure()
        self._references = FlightReferences(self.values)

    def aided_by(self, stamp_ns: int, received: Received) -> tuple[Any, ...]:
        gyro_b, gyro_valid = self.calibrated.rate(received["gyro"])
        field_b, field_valid = self.calibrated.field(received["field"])
        at = self._references.at((stamp_ns - self.epoch_ns) * 1e-9)
        return gyro_b, gyro_valid, field_b, field_valid, at, self._references.light


main = node_main(AttitudeFilter)
