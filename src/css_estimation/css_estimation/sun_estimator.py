# SPDX-License-Identifier: Apache-2.0
"""A Sun estimator as a component of the graph; a node file only names the algorithm."""

from types import ModuleType
from typing import ClassVar

from sensor_msgs.msg import Imu

from css_common.component import Component, Input, Outgoing, Output, Received
from css_common.kernel import typed_call
from css_common.schema import Values
from css_estimation.eclipse_prediction import EclipsePrediction
from css_estimation.messages import gyro_reading, sun_estimate_fields
from css_estimation.sun_heading import PREDICTION_UNKNOWN
from css_msgs.msg import CssVoltages, SunEstimate


class SunEstimator(Component):
    """Cell outputs and, while it delivers, the gyro in; `<node name>/sun_estimate` out.

    Class attributes:
        algorithm: module of the shape that `css_estimation.sun_heading` describes.
    """

    shared = ("cells", "orbit")
    algorithm: ClassVar[ModuleType]

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        return (
            Input(
                "cells",
                "css/voltages",
                CssVoltages,
                lengths={"voltages": len(values.cells.normals)},
            ),
            Input("gyro", "gyro/imu", Imu, required=False, used=("angular_velocity",)),
        )

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        return (Output("estimate", f"{name}/sun_estimate", SunEstimate, ends_cycle=True),)

    def configure(self) -> None:
        self._parameters = self.algorithm.parameters(self.values)
        self._state = self.algorithm.initial_state(self._parameters)
        self._step = typed_call(self.algorithm.step)
        self._last_stamp_ns: int | None = None
        sensors_decide = self.values.eclipse.source == "sensors"
        self._prediction = None if sensors_decide else EclipsePrediction(self.values)

    def tune(self, values: Values) -> None:
        super().tune(values)
        self._parameters = self.algorithm.parameters(values)

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        since_ns = self.period_ns if self._last_stamp_ns is None else stamp_ns - self._last_stamp_ns
        self._last_stamp_ns = stamp_ns
        cells = received["cells"]
        assert cells is not None  # a required input
        gyro_b, gyro_valid = gyro_reading(received["gyro"])
        predicted = PREDICTION_UNKNOWN if self._prediction is None else self._prediction.at(stamp_ns)
        self._state, heading = self._step(
            self._parameters,
            self._state,
            since_ns / 1e9,
            cells.voltages,
            gyro_b,
            gyro_valid,
            predicted,
        )
        return {"estimate": self.message("estimate", stamp_ns, **sun_estimate_fields(heading))}
