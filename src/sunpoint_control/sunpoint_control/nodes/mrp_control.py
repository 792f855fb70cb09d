# SPDX-License-Identifier: Apache-2.0
"""Sun-pointing control of the spacecraft with wheels and, if fitted, torque rods."""

from collections.abc import Iterable, Mapping

import numpy as np

from css_common.component import Component, Finding, Input, Outgoing, Output, Received
from css_common.kernel import typed_call
from css_common.mission import Node
from css_common.run import node_main
from css_common.schema import Values
from css_common.sensor_inputs import field_input
from css_common.vectors import vector_of
from css_msgs.msg import ControlStatus, RodDipoleCommand, SunEstimate, WheelState, WheelTorqueCommand
from sunpoint_control import sun_pointing_control as control
from sunpoint_control.control_checks import control_findings
from sunpoint_control.modes import MODE_SAFE, REASON_COMMANDED

_ZERO = (0.0, 0.0, 0.0)


class MrpControl(Component):
    """Turns the solar arrays to the estimated Sun by MRP feedback on the wheels (O'Keefe & Schaub 2013)."""

    shared = ("spacecraft", "wheels", "rods", "magnetometer", "graph")
    parameters = control.PARAMETERS

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        inputs = [
            Input(
                "sun",
                f"{values.graph.estimator}/sun_estimate",
                SunEstimate,
                used=("sun_b", "omega_bn_b"),
            ),
            Input(
                "wheels",
                "wheels/state",
                WheelState,
                lengths={"speed": len(values.wheels.axes)},
                used=("speed",),
            ),
        ]
        if values.rods.fitted:
            inputs.append(field_input(values))
        return tuple(inputs)

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        outputs = [
            Output("wheels", "wheels/torque_command", WheelTorqueCommand, ends_cycle=True),
            Output("status", "control/status", ControlStatus),
        ]
        if values.rods.fitted:
            outputs.append(Output("rods", "rods/dipole_command", RodDipoleCommand, ends_cycle=True))
        return tuple(outputs)

    @classmethod
    def needed(cls, values: Values) -> tuple[str, ...]:
        return ("spacecraft.inertia", "wheels.axes") if values.wheels.fitted else ("spacecraft.inertia",)

    @classmethod
    def conflicts(cls, values: Values) -> Iterable[str]:
        return control.conflicts(values)

    @classmethod
    def preflight(cls, node: Node, graph: Mapping[str, Node]) -> Iterable[Finding]:
        return control_findings(node, graph)

    def configure(self) -> None:
        self._parameters = control.parameters(self.values)
        self._state = control.initial_state(self._parameters)
        self._step = typed_call(control.step)
        self._last_stamp_ns: int | None = None
        self._field_b = _ZERO
        self._field_stamp_ns: int | None = None

    def tune(self, values: Values) -> None:
        super().tune(values)
        self._parameters = control.parameters(values)

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        since_ns = self.period_ns if self._last_stamp_ns is None else stamp_ns - self._last_stamp_ns
        self._last_stamp_ns = stamp_ns
        sun, wheels = received["sun"], received["wheels"]
        assert sun is not None and wheels is not None  # required inputs
        torques = np.zeros(len(self.values.wheels.axes))
        dipoles = np.zeros(len(self.values.rods.axes))
        self._state, output = self._step(
            self._parameters,
            self._state,
            since_ns / 1e9,
            vector_of(sun.sun_b),
            sun.validity,
            sun.eclipse,
            vector_of(sun.omega_bn_b),
            sun.rate_source,
            wheels.speed,
            *self._field(stamp_ns, received),
            torques,
            dipoles,
        )
        return self._commands(stamp_ns, torques, dipoles, output)

    def idle(self, stamp_ns: int, received: Received) -> Outgoing:
        """Actuators at rest, so that the flight goes on while the control is deactivated."""
        self._last_stamp_ns = None
        self._state = control.initial_state(self._parameters)
        torques = np.zeros(len(self.values.wheels.axes))
        dipoles = np.zeros(len(self.values.rods.axes))
        return self._commands(stamp_ns, torques, dipoles, control.at_rest(MODE_SAFE, REASON_COMMANDED))

    def _field(self, stamp_ns: int, received: Received) -> tuple[tuple[float, float, float], bool]:
        """Last field measurement, for as long as the next may be on its way."""
        field = received.get("field")
        if field is not None and field.magnetic_field_covariance[0] != -1.0:
            self._field_b = vector_of(field.magnetic_field)
            self._field_stamp_ns = stamp_ns
        if self._field_stamp_ns is None:
            return _ZERO, False
        longest_ns = self.values.magnetometer.divider * self.period_ns
        return self._field_b, stamp_ns - self._field_stamp_ns < longest_ns

    def _commands(
        self, stamp_ns: int, torques: np.ndarray, dipoles: np.ndarray, output: control.ControlOutput
    ) -> Outgoing:
        messages = {
            "wheels": self.message("wheels", stamp_ns, saturated=output.wheels_saturated, torque=torques),
            "status": self.message(
                "status",
                stamp_ns,
                torque_b=np.array(output.torque_b),
                integral=np.array(output.integral),
                wheel_momentum_b=np.array(output.wheel_momentum_b),
                pointing_error=output.pointing_error,
                rate=output.rate,
                mode=output.mode,
                reason=output.reason,
                deadband=int(output.deadband),
                dumping=int(output.dumping),
            ),
        }
        if self.values.rods.fitted:
            messages["rods"] = self.message("rods", stamp_ns, saturated=output.rods_saturated, dipole=dipoles)
        return messages


main = node_main(MrpControl)

if __name__ == "__main__":
    raise SystemExit(main())
