# SPDX-License-Identifier: Apache-2.0
"""A control law as a component of the graph; a node file names the algorithm and what it listens to."""

import math
from collections.abc import Iterable
from typing import ClassVar

import numpy as np

from css_common.actuator_sections import wheel_axes
from css_common.codec import Sample
from css_common.component import Component, Input, Outgoing, Output, Received
from css_common.health import KIND_SCALED, KIND_SIGN, SORT_WHEEL, Verdict
from css_common.health_report import HealthReport, health_output
from css_common.kernel import typed_call
from css_common.schema import Values
from css_common.sensor_inputs import field_input
from css_common.vectors import Vec3, vector_of
from css_msgs.msg import ControlStatus, RodDipoleCommand, SunEstimate, WheelState, WheelTorqueCommand
from css_sensors.calibrated_readings import CalibratedReadings
from sunpoint_control.control_algorithm import ControlAlgorithm
from sunpoint_control.control_output import ControlOutput, at_rest
from sunpoint_control.held_field import NO_FIELD_MEASURED, HeldField
from sunpoint_control.modes import MODE_SAFE, REASON_COMMANDED

_ZERO: Vec3 = (0.0, 0.0, 0.0)
_NO_SUN = (_ZERO, SunEstimate.VALIDITY_NONE, SunEstimate.ECLIPSE_SUNLIT, _ZERO, SunEstimate.RATE_NONE)
# no number, which a control takes for inputs that cannot be trusted: actuators at rest, soon in safe mode
_LOST: Vec3 = (math.nan, math.nan, math.nan)
_SUN_LOST = (_LOST, SunEstimate.VALIDITY_NONE, SunEstimate.ECLIPSE_SUNLIT, _LOST, SunEstimate.RATE_NONE)


class Controller(Component):
    """Sun estimate and, as they are fitted, wheel speeds and magnetic field in; commands and `control/status` out.

    Class attributes:
        algorithm: module of this shape.
        needs_sun: without a Sun estimate there is no cycle, and in real time, which does not wait, none that acts.
        turns_wheels: it commands the wheels.
    """

    shared: ClassVar[tuple[str, ...]] = ("spacecraft", "wheels", "rods", "magnetometer", "graph")
    algorithm: ClassVar[ControlAlgorithm]
    needs_sun: ClassVar[bool] = True
    turns_wheels: ClassVar[bool] = True

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        inputs = [
            Input(
                "sun",
                f"{values.graph.estimator}/sun_estimate",
                SunEstimate,
                required=cls.needs_sun,
                outlived=cls.needs_sun,
                used=("sun_b", "omega_bn_b"),
            )
        ]
        if cls.turns_wheels:
            lengths = {"speed": len(values.wheels.axes)}
            inputs.append(Input("wheels", "wheels/state", WheelState, lengths=lengths, used=("speed",)))
        if values.rods.fitted:
            inputs.append(field_input(values))
        return tuple(inputs)

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        outputs = [Output("status", "control/status", ControlStatus)]
        if cls.turns_wheels:
            outputs.insert(0, Output("wheels", "wheels/torque_command", WheelTorqueCommand, ends_cycle=True))
        if values.rods.fitted:
            outputs.append(Output("rods", "rods/dipole_command", RodDipoleCommand, ends_cycle=True))
        if cls.turns_wheels:
            outputs.append(health_output(name))
        return tuple(outputs)

    @classmethod
    def conflicts(cls, values: Values) -> Iterable[str]:
        return cls.algorithm.conflicts(values)

    def configure(self) -> None:
        self._parameters = self.algorithm.parameters(self.values)
        self._state = self.algorithm.initial_state(self._parameters)
        self._memory = self.algorithm.initial_memory(self._parameters)
        self._health = HealthReport(_what_was_done)
        self._step = typed_call(self.algorithm.step)
        self._last_stamp_ns: int | None = None
        self._calibrated = CalibratedReadings(self.values)
        self._field = NO_FIELD_MEASURED
        self._field_stamp_ns: int | None = None

    def tune(self, values: Values) -> None:
        super().tune(values)
        self._parameters = self.algorithm.parameters(values)

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        since_ns = self.period_ns if self._last_stamp_ns is None else stamp_ns - self._last_stamp_ns
        self._last_stamp_ns = stamp_ns
        torques, dipoles = self._actuators()
        wheels = received.get("wheels")
        self._state, output = self._step(
            self._parameters,
            self._state,
            self._memory,
            since_ns / 1e9,
            *_sun(received["sun"], _SUN_LOST if self.needs_sun else _NO_SUN),
            torques if wheels is None else wheels.speed,
            self._held_field(stamp_ns, received),
            torques,
            dipoles,
        )
        commands = self._commands(stamp_ns, torques, dipoles, output)
        if not self.turns_wheels:
            return commands
        told = self._health.told(self, stamp_ns, self._memory.verdicts, int(self._memory.body["cycle"][0]))
        return {**commands, **told}

    def idle(self, stamp_ns: int, received: Received) -> Outgoing:
        """Actuators at rest, so that the flight goes on while the control is deactivated."""
        self._last_stamp_ns = None
        self._state = self.algorithm.initial_state(self._parameters)
        self._memory = self.algorithm.initial_memory(self._parameters)
        return self._commands(stamp_ns, *self._actuators(), at_rest(MODE_SAFE, REASON_COMMANDED))

    def _actuators(self) -> tuple[np.ndarray, np.ndarray]:
        """Room for the motor torques of the wheels and the dipoles of the rods, at rest."""
        wheels = len(wheel_axes(self.values)) if self.turns_wheels else 0
        return np.zeros(wheels), np.zeros(len(self.values.rods.axes))

    def _held_field(self, stamp_ns: int, received: Received) -> HeldField:
        """Last field measurement, for as long as the next may be on its way."""
        field_b, fresh = self._calibrated.field(received.get("field"))
        if fresh:
            self._field_stamp_ns = stamp_ns
        else:
            field_b = self._field.field_b
        longest_ns = self.values.magnetometer.divider * self.period_ns
        valid = self._field_stamp_ns is not None and stamp_ns - self._field_stamp_ns < longest_ns
        self._field = HeldField(field_b, valid, fresh)
        return self._field

    def _commands(self, stamp_ns: int, torques: np.ndarray, dipoles: np.ndarray, output: ControlOutput) -> Outgoing:
        messages = {}
        if self.turns_wheels:
            messages["wheels"] = self.message("wheels", stamp_ns, saturated=output.wheels_saturated, torque=torques)
        messages["status"] = self.message(
            "status",
            stamp_ns,
            torque_b=np.array(output.torque_b),
            integral=np.array(output.integral),
            wheel_momentum_b=np.array(output.wheel_momentum_b),
            pointing_error=output.pointing_error,
            rate=output.rate,
            wheels_isolated=output.wheels_isolated,
            rods_isolated=output.rods_isolated,
            mode=output.mode,
            reason=output.reason,
            deadband=int(output.deadband),
            dumping=int(output.dumping),
        )
        if self.values.rods.fitted:
            messages["rods"] = self.message("rods", stamp_ns, saturated=output.rods_saturated, dipole=dipoles)
        return messages


def _what_was_done(verdict: Verdict) -> str:
    if verdict.sort == SORT_WHEEL:
        return "commanded by what it gives" if verdict.kind in (KIND_SCALED, KIND_SIGN) else "commanded nothing"
    return "its speed counted from what the wheel is commanded"


def _sun(sun: Sample | None, otherwise: tuple[Vec3, int, int, Vec3, int]) -> tuple[Vec3, int, int, Vec3, int]:
    """Direction, validity, eclipse, body rate and its source."""
    if sun is None:
        return otherwise
    return vector_of(sun.sun_b), sun.validity, sun.eclipse, vector_of(sun.omega_bn_b), sun.rate_source
