# SPDX-License-Identifier: Apache-2.0
"""A Sun estimator as a component of the graph; a node file only names the algorithm."""

from collections.abc import Iterable, Mapping
from typing import ClassVar

import numpy as np

from css_common.component import Component, Input, Outgoing, Output, Received, Smoothing
from css_common.kernel import typed_call
from css_common.schema import Values
from css_common.sections import PERIOD, needed_of_orbit, needed_of_wheel_momentum
from css_common.sensor_inputs import field_input, gyro_input
from css_estimation.messages import cells_input, field_reading, gyro_reading, sun_estimate_fields, wheels_input
from css_estimation.sun.field_rate import USE_FIELD as RATE_BY_FIELD
from css_estimation.sun.flight_sky import USE_FIELD, asks_for_sky, flight_sky, sky_at
from css_estimation.sun.low_pass import low_pass_gain
from css_estimation.sun.mode_log import ModeLog
from css_estimation.sun.sun_algorithm import SunAlgorithm
from css_estimation.sun.sun_heading import Aiding, Sky
from css_estimation.sun.sun_tracking import RATE_CUTOFF, USE_GYRO
from css_msgs.msg import SunEstimate

_NO_SPEEDS = np.zeros(0)


def hears_field(values: Values) -> bool:
    """Whether an estimator with these values listens to the magnetometer."""
    return any(parameter in values and values[parameter] for parameter in (RATE_BY_FIELD, USE_FIELD))


def hears_wheels(values: Values) -> bool:
    """Whether it listens to the speeds of the wheels."""
    return hasattr(values, "use_wheels") and values.use_wheels and values.wheels.fitted and len(values.wheels.axes) > 0


def inputs_of(values: Values) -> tuple[Input, ...]:
    """Cells, and what else an algorithm with these values listens to."""
    inputs = [cells_input(values)]
    if USE_GYRO in values:
        inputs.append(gyro_input(values))
    if hears_field(values):
        inputs.append(field_input(values))
    if hears_wheels(values):
        inputs.append(wheels_input(values))
    return tuple(inputs)


def _low_pass_gain(values: Values) -> float:
    """Share of a new rate that the low pass of `rate.cutoff` takes in; all of it without one."""
    return low_pass_gain.py_func(values[RATE_CUTOFF], values[PERIOD]) if RATE_CUTOFF in values else 1.0


def aiding_of(received: Received, sky: Sky) -> Aiding:
    """What an algorithm is given beside the cells, of the inputs of one stamp."""
    wheels = received.get("wheels")
    return Aiding(
        *gyro_reading(received.get("gyro")),
        *field_reading(received.get("field")),
        _NO_SPEEDS if wheels is None else wheels.speed,
        wheels is not None,
        sky,
    )


class SunEstimator(Component):
    """Cell outputs and, while they deliver, gyro and magnetometer in; `<node name>/sun_estimate` out.

    Class attributes:
        algorithm: module of this shape.
        mode_names: names of its modes, if changes between them are worth a line in the log.
    """

    shared: ClassVar[tuple[str, ...]] = ("cells", "orbit", "magnetometer")
    algorithm: ClassVar[SunAlgorithm]
    mode_names: ClassVar[Mapping[int, str]] = {}

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        return inputs_of(values)

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        return (Output("estimate", f"{name}/sun_estimate", SunEstimate, ends_cycle=True),)

    @classmethod
    def needed(cls, values: Values) -> tuple[str, ...]:
        orbit = needed_of_orbit(values) if asks_for_sky(values) else ()
        wheels = needed_of_wheel_momentum(values) if "wheels" in cls.shared else ()
        return ("cells.normals", *orbit, *wheels)

    @classmethod
    def conflicts(cls, values: Values) -> Iterable[str]:
        of_algorithm = getattr(cls.algorithm, "conflicts", None)
        return () if of_algorithm is None else of_algorithm(values)

    @classmethod
    def smoothing(cls, values: Values) -> Smoothing:
        # in plain Python: loading the compiled one takes a second that a check before the flight need not wait for
        heading_gain = getattr(cls.algorithm, "heading_gain", None)
        rate_gain = getattr(cls.algorithm, "rate_gain", _low_pass_gain)
        return Smoothing(rate=rate_gain(values), heading=1.0 if heading_gain is None else heading_gain(values))

    def configure(self) -> None:
        self._parameters = self.algorithm.parameters(self.values)
        self._state = self.algorithm.initial_state(self._parameters)
        self._memory = self.algorithm.initial_memory(self._parameters)
        self._step = typed_call(self.algorithm.step)
        self._last_stamp_ns: int | None = None
        self._mode_log = ModeLog(self.mode_names, self.epoch_ns) if self.mode_names else None
        self._sky = flight_sky(self.values)

    def tune(self, values: Values) -> None:
        super().tune(values)
        self._parameters = self.algorithm.parameters(values)

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        since_ns = self.period_ns if self._last_stamp_ns is None else stamp_ns - self._last_stamp_ns
        self._last_stamp_ns = stamp_ns
        cells = received["cells"]
        assert cells is not None  # a required input
        aiding = aiding_of(received, sky_at(self._sky, stamp_ns))
        self._state, heading = self._step(
            self._parameters,
            self._state,
            self._memory,
            since_ns / 1e9,
            cells.voltages,
            aiding,
        )
        if self._mode_log is not None:
            line = self._mode_log.line(stamp_ns, heading.mode)
            if line is not None:
                self.report(line)
        return {"estimate": self.message("estimate", stamp_ns, **sun_estimate_fields(heading))}
