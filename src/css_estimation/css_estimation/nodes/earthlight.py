# SPDX-License-Identifier: Apache-2.0
"""Attitude about all three axes from cells, gyro or wheels, and the orbit; no magnetometer."""

from collections.abc import Iterable
from types import ModuleType
from typing import Any, ClassVar

from css_common.actuator_sections import needed_of_wheel_momentum
from css_common.component import Input, Received
from css_common.run import node_main
from css_common.schema import Values
from css_estimation.attitude.attitude_estimator import AttitudeEstimator
from css_estimation.sun.flight_sky import flight_sky, sky_at
from css_estimation.sun.sun_estimator import aiding_of, inputs_of
from css_estimation.sun_filter import earthlight


class Earthlight(AttitudeEstimator):
    """Attitude by the Sun filter: the Sun is one direction, the light of the Earth on the cells the other."""

    algorithm: ClassVar[ModuleType] = earthlight
    shared = ("cells", "orbit", "gyro", "magnetometer", "spacecraft", "wheels")
    parameters = earthlight.PARAMETERS

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        return inputs_of(values)

    @classmethod
    def needed(cls, values: Values) -> tuple[str, ...]:
        return (*super().needed(values), *needed_of_wheel_momentum(values))

    @classmethod
    def conflicts(cls, values: Values) -> Iterable[str]:
        return earthlight.conflicts(values)

    def configure(self) -> None:
        super().configure()
        self._sky = flight_sky(self.values)

    def aided_by(self, stamp_ns: int, received: Received) -> tuple[Any, ...]:
        return (aiding_of(received, sky_at(self._sky, stamp_ns), self.calibrated),)


main = node_main(Earthlight)
