# SPDX-License-Identifier: Apache-2.0
"""A Sun estimator as a component of the graph; a node file only names the algorithm."""

from collections.abc import Callable, Iterable, Mapping
from typing import ClassVar

import numpy as np

from css_common.actuator_sections import needed_of_wheel_momentum
from css_common.component import Component, Cycles, Finding, Input, Outgoing, Output, Received, Smoothing, Standing
from css_common.declared import merged
from css_common.health_report import HealthReport, health_output
from css_common.kernel import typed_call
from css_common.message_columns import Columns
from css_common.mission_node import Node
from css_common.mission_section import PERIOD
from css_common.orbit_section import needed_of_orbit
from css_common.schema import Table, Values
from css_common.sensor_inputs import FULL_SUN_LUX, field_input, gyro_input, sunlight_input
from css_estimation.health import watched
from css_estimation.messages import cells_input, sun_estimate_fields, wheels_input
from css_estimation.sun.field_rate import USE_FIELD as RATE_BY_FIELD
from css_estimation.sun.flight_sky import USE_FIELD, asks_for_sky, flagged, flight_sky, hears_flag, sky_at
from css_estimation.sun.heading_dispatch import home_of
from css_estimation.sun.heading_loop import cycle_of
from css_estimation.sun.low_pass import low_pass_gain
from css_estimation.sun.mode_log import ModeLog
from css_estimation.sun.sun_algorithm import SunAlgorithm
from css_estimation.sun.sun_heading import Aiding, Measured, Sky
from css_estimation.sun.sun_tracking import RATE_CUTOFF, USE_GYRO
from css_msgs.msg import SunEstimate
from css_sensors.calibrated_readings import CalibratedReadings, temperature_findings, temperature_inputs

_NO_SPEEDS = np.zeros(0)


def hears_field(values: Values) -> bool:
    """Whether an estimator with these values listens to the magnetometer."""
    return any(parameter in values and values[parameter] for parameter in (RATE_BY_FIELD, USE_FIELD))


def hears_wheels(values: Values) -> bool:
    """Whether it listens to the speeds of the wheels."""
    return hasattr(values, "use_wheels") and values.use_wheels and values.wheels.fitted and len(values.wheels.axes) > 0


def inputs_of(values: Values) -> tuple[Input, ...]:
    """Cells, and what else an algorithm with these values listens to."""
    inputs = [cells_input(values), *temperature_inputs(values)]
    if USE_GYRO in values:
        inputs.append(gyro_input(values))
    if hears_field(values):
        inputs.append(field_input(values))
    if hears_flag(values):
        inputs.append(sunlight_input())
    if hears_wheels(values):
        inputs.append(wheels_input(values))
    return tuple(inputs)


def _low_pass_gain(values: Values) -> float:
    """Share of a new rate that the low pass of `rate.cutoff` takes in; all of it without one."""
    return low_pass_gain.py_func(values[RATE_CUTOFF], values[PERIOD]) if RATE_CUTOFF in values else 1.0


def aiding_of(received: Received, sky: Sky, calibrated: CalibratedReadings) -> Aiding:
    """What an algorithm is given beside the cells, of the inputs of one stamp."""
    gyro_b, gyro_valid = calibrated.rate(received.get("gyro"))
    field_b, field_valid = calibrated.field(received.get("field"))
    wheels = received.get("wheels")
    return Aiding(
        gyro_b,
        gyro_valid,
        field_b,
        field_valid,
        _NO_SPEEDS if wheels is None else wheels.speed,
        wheels is not None,
        sky,
    )


def measured_in(steps: Cycles, calibrated: CalibratedReadings) -> Measured | None:
    """What an algorithm is given beside the models at many steps; None when wheels are silent at some of them alone."""
    count = len(steps.stamps_ns)
    speeds = steps.spread("wheels", "speed")
    if speeds is not None and not speeds[1].all():
        return None
    rates_b, rates_valid = _vectors(steps, "gyro", "angular_velocity", calibrated.rates)
    fields_b, fields_valid = _vectors(steps, "field", "magnetic_field", calibrated.fields)
    return Measured(
        calibrated.cells(steps.columns["cells"].voltages),
        rates_b,
        rates_valid,
        fields_b,
        fields_valid,
        np.zeros((count, 0)) if speeds is None else speeds[0],
        speeds is not None,
    )


def _vectors(
    steps: Cycles, key: str, field: str, corrected: Callable[[np.ndarray], np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """The vectors (M, 3) of an input, zero where it measured none, and whether it did (M,); as one message."""
    given, variances = steps.spread(key, field), steps.spread(key, f"{field}_covariance")
    if given is None or variances is None:
        return np.zeros((len(steps.stamps_ns), 3)), np.zeros(len(steps.stamps_ns), np.bool_)
    (vectors, there), (covariance, _) = given, variances
    valid = there & (covariance[:, 0] != -1.0)
    return np.where(valid[:, np.newaxis], corrected(vectors), 0.0), valid


class SunEstimator(Component):
    """Cell outputs and, while they deliver, gyro and magnetometer in; `<node name>/sun_estimate` out.

    Class attributes:
        algorithm: module of this shape.
        mode_names: names of its modes, if changes between them are worth a line in the log.
    """

    shared: ClassVar[tuple[str, ...]] = ("cells", "orbit", "gyro", "magnetometer")
    algorithm: ClassVar[SunAlgorithm]
    mode_names: ClassVar[Mapping[int, str]] = {}

    @classmethod
    def table(cls) -> Table:
        return merged(super().table(), watched.PARAMETERS)

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        return inputs_of(values)

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        estimate = Output("estimate", f"{name}/sun_estimate", SunEstimate, ends_cycle=True)
        return (estimate, health_output(name)) if values[watched.ENABLED] else (estimate,)

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

    @classmethod
    def preflight(cls, node: Node, graph: Mapping[str, Node]) -> Iterable[Finding]:
        return temperature_findings(node.values, graph)

    def configure(self) -> None:
        self._parameters = watched.watched_parameters(self.algorithm, self.values)
        self._state = watched.initial_state(self.algorithm, self._parameters)
        self._memory = watched.initial_memory(self.algorithm, self._parameters)
        own = self._parameters.own if isinstance(self._parameters, watched.Watched) else self._parameters
        # the loop finds `step` by the type of the parameters, which may be those of another module
        self._is_found = getattr(home_of(own), "step", None) is self.algorithm.step
        if self._is_found:
            self._step = typed_call(cycle_of(self.algorithm.step.__module__))
        else:
            self._step = watched.stepped_by(self.algorithm.step)
        self._calibrated = CalibratedReadings(self.values)
        self._last_stamp_ns: int | None = None
        self._mode_log = ModeLog(self.mode_names, self.epoch_ns) if self.mode_names else None
        self._sky = flight_sky(self.values)
        self._by_flag = hears_flag(self.values)
        self._health = HealthReport() if self.values[watched.ENABLED] else None
        self._cycles = 0

    def tune(self, values: Values) -> None:
        super().tune(values)
        self._parameters = watched.watched_parameters(self.algorithm, values)

    def standing(self) -> Standing:
        return Standing(self._calibrated.warning)

    def cycle_through(self, steps: Cycles) -> Mapping[str, Columns] | None:
        # here, as no node in flight needs it
        from css_estimation.sun.heading_loop import loop_of, new_headings
        from css_estimation.sun.sky_table import sky_table

        if self._by_flag:
            return None  # what the spacecraft says of the shadow comes at times of its own
        measured = measured_in(steps, self._calibrated)
        if measured is None or not self._is_found or not self._silent_so_far(int(steps.stamps_ns[0])):
            return None
        stamps = steps.stamps_ns
        before = stamps[0] - self.period_ns if self._last_stamp_ns is None else self._last_stamp_ns
        since_s = np.diff(stamps, prepend=before) / 1e9
        headings = new_headings(len(stamps))
        advance = loop_of(self.algorithm.step.__module__)
        sky = sky_table(self._sky, stamps.tolist())
        changes = watched.verdict_changes(self._memory)
        self._state = advance(self._parameters, self._state, self._memory, since_s, measured, *sky, headings)
        if self._health is not None and changes != watched.verdict_changes(self._memory):
            # to be done again cycle by cycle, so that each change is told at its stamp
            return None
        self._cycles += len(stamps)
        self._last_stamp_ns = int(stamps[-1])
        if self._mode_log is not None:
            for stamp_ns, mode in zip(stamps.tolist(), headings.mode.tolist(), strict=True):
                self._tell(stamp_ns, mode)
        return {"estimate": Columns(stamps, **headings._asdict())}

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        since_ns = self.period_ns if self._last_stamp_ns is None else stamp_ns - self._last_stamp_ns
        self._last_stamp_ns = stamp_ns
        cells = received["cells"]
        assert cells is not None  # a required input
        sky = sky_at(self._sky, stamp_ns)
        if self._by_flag:
            sunlight = received.get("sunlight")
            sky = flagged(sky, None if sunlight is None else min(1.0, max(0.0, sunlight.illuminance / FULL_SUN_LUX)))
        aiding = aiding_of(received, sky, self._calibrated)
        self._state, heading = self._step(
            self._parameters,
            self._state,
            self._memory,
            since_ns / 1e9,
            self._calibrated.cells(cells.voltages, received.get("temperature")),
            aiding,
        )
        self._tell(stamp_ns, heading.mode)
        estimate = self.message("estimate", stamp_ns, **sun_estimate_fields(heading))
        return {"estimate": estimate, **self._told_health(stamp_ns)}

    def _silent_so_far(self, stamp_ns: int) -> bool:
        """Whether nothing need be told of health before a verdict changes, in cycles from a stamp on."""
        if self._health is None or self._cycles > 0:
            return True
        if self.step_of(stamp_ns) != 0:
            return False
        # at the first stamp of a flight no verdict is no news
        self._health.told(self, stamp_ns, watched.verdicts_of(self._memory), 0)
        return True

    def _told_health(self, stamp_ns: int) -> Outgoing:
        """What is said of the health of sensors after a cycle, if that has changed."""
        if self._health is None:
            return {}
        self._cycles += 1
        return self._health.told(self, stamp_ns, watched.verdicts_of(self._memory), self._cycles)

    def _tell(self, stamp_ns: int, mode: int) -> None:
        line = self._mode_log.line(stamp_ns, mode) if self._mode_log is not None else None
        if line is not None:
            self.report(line)
