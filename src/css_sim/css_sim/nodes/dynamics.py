# SPDX-License-Identifier: Apache-2.0
"""Simulated spacecraft, the owner of simulated time."""

from collections.abc import Iterable, Mapping

import numpy as np
from geometry_msgs.msg import PoseStamped

from css_common.actuator_sections import ROD_AXES, RODS_FITTED, WHEEL_AXES, WHEELS_FITTED, needed_of_wheels
from css_common.attitude import mrp_to_quaternion
from css_common.codec import Sample
from css_common.component import INERTIAL, Finding, Input, Outgoing, Output, Plant, Received
from css_common.fault_lines import FAULTS, Units
from css_common.kernel import typed_call
from css_common.mission_node import Node
from css_common.mission_section import CASE, DURATION, PERIOD, SEED
from css_common.orbit_section import needed_of_orbit
from css_common.random_streams import random_key
from css_common.run import node_main
from css_common.schema import Values, flag, integer
from css_msgs.msg import RodDipoleCommand, SpacecraftState, WheelState, WheelTorqueCommand
from css_sim import (
    actuator_faults,
    disturbances,
    failing,
    flight_environment,
    initial_conditions,
    orbit_dispersion,
    tachometer,
)
from css_sim.actuator_faults import new_felt, spoil_actuators
from css_sim.failing import Failing, fault_outputs
from css_sim.flight_checks import check_rate, fastest_start, plant_findings
from css_sim.rigid_body import wheel_speeds
from css_sim.spacecraft import advance, spacecraft

_SUBSTEPS = integer(
    "substeps", 1, "-", "least integration steps per control cycle; fast motion has more", low=1, high=1000
)
_POSE = flag("publish_pose", False, "also publish the body's pose, for displays")


class Dynamics(Plant):
    """Turns the spacecraft under wheels, rods and disturbances along its orbit, and publishes the truth."""

    shared = ("orbit", "spacecraft", "wheels", "rods", "lockstep")
    fault_kinds = actuator_faults.KINDS
    parameters = (
        *initial_conditions.PARAMETERS,
        *orbit_dispersion.PARAMETERS,
        *flight_environment.PARAMETERS,
        *disturbances.PARAMETERS,
        *tachometer.PARAMETERS,
        *failing.PARAMETERS,
        _SUBSTEPS,
        _POSE,
    )

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        wheels = Input(
            "wheels",
            "wheels/torque_command",
            WheelTorqueCommand,
            required=False,  # a mission may fly without control
            lengths={"torque": len(values[WHEEL_AXES])},
            used=("torque",),
        )
        rods = Input(
            "rods",
            "rods/dipole_command",
            RodDipoleCommand,
            required=False,
            lengths={"dipole": len(values[ROD_AXES])},
            used=("dipole",),
        )
        fitted = ((wheels, values[WHEELS_FITTED]), (rods, values[RODS_FITTED]))
        return tuple(actuator for actuator, is_there in fitted if is_there)

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        outputs = [Output("truth", "truth", SpacecraftState, frame=INERTIAL)]
        if values[WHEELS_FITTED]:
            outputs.append(Output("wheels", "wheels/state", WheelState))
            if _speeds_err(values):
                outputs.append(Output("true_wheels", "truth/wheels", WheelState))
        if values[_POSE]:
            outputs.append(Output("pose", "truth/pose", PoseStamped, frame=INERTIAL))
        outputs += fault_outputs(name, values)
        return tuple(outputs)

    @classmethod
    def fault_units(cls, values: Values) -> Units:
        return actuator_faults.units(values)

    @classmethod
    def needed(cls, values: Values) -> tuple[str, ...]:
        return (*needed_of_orbit(values), "spacecraft.inertia", *needed_of_wheels(values))

    @classmethod
    def conflicts(cls, values: Values) -> Iterable[str]:
        yield from disturbances.conflicts(values)
        yield from initial_conditions.conflicts(values)
        yield from orbit_dispersion.conflicts(values)

    @classmethod
    def preflight(cls, node: Node, graph: Mapping[str, Node]) -> Iterable[Finding]:
        return plant_findings(node, graph)

    @classmethod
    def fastest_start(cls, values: Values) -> float:
        return fastest_start(values)

    def configure(self) -> None:
        values = self.values
        self._key = key = random_key(values[SEED], values[CASE])
        self._craft = spacecraft(values, key, values[_SUBSTEPS])
        self._faults = actuator_faults.of_case(values, key)
        self._failing = Failing(self._faults.of(values[FAULTS]))
        self._take_faults()
        self._environment = flight_environment.flight_environment(
            values, orbit=orbit_dispersion.case_orbit(values, key)
        )
        self._state = initial_conditions.initial_state(initial_conditions.parameters(values), key)
        self._momentum = initial_conditions.initial_wheel_momentum(
            self._craft.body, self._state.omega_bn_b, values[initial_conditions.WHEEL_SPEEDS]
        )
        self._wheels_at_rest = np.zeros(len(self._momentum))
        self._rods_at_rest = np.zeros(len(self._craft.rod_axes_b))
        self._torque = np.zeros(len(self._momentum))
        self._tachometer = tachometer.parameters(values)
        self._advance, self._wheel_speeds = typed_call(advance), typed_call(wheel_speeds)
        self._spoil = typed_call(spoil_actuators)
        # compiled before the flight: faults may be injected into it
        wheels, torque, dipole = self._craft.body.wheels, self._wheels_at_rest, self._rods_at_rest
        self._spoil(self._failing.table[:0], key, 0, wheels, torque, dipole, self._felt)
        self._report = typed_call(tachometer.report)
        self._steps = round(values[DURATION] / values[PERIOD])
        self.finished = False

    def tune(self, values: Values) -> None:
        super().tune(values)
        self._failing.take(self._faults.of(values[FAULTS]))
        self._take_faults()

    def untimely(self, values: Values) -> str | None:
        if _tachometers_fail(values) and "true_wheels" not in self.frames:
            return "faults: nobody tells the true speeds on truth/wheels, expected report_faults: true from the start"
        return None

    def _take_faults(self) -> None:
        body = self._craft.body
        self._felt = new_felt(body.wheels, len(self._craft.rod_axes_b))
        self._faulty = self._craft._replace(body=body._replace(wheels=self._felt.wheels))

    def begin(self) -> Outgoing:
        return self._messages(self.epoch_ns, 0, 0)

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        wheels, rods = received.get("wheels"), received.get("rods")
        craft = self._craft
        torque = self._wheels_at_rest if wheels is None else wheels.torque
        dipole = self._rods_at_rest if rods is None else rods.dipole
        if len(self._failing.table):
            step, felt = self.step_of(stamp_ns), self._felt
            self._spoil(self._failing.table, self._key, step, craft.body.wheels, torque, dipole, felt)
            craft, torque, dipole = self._faulty, felt.torque, felt.dipole
        self._state, torque_limited, speed_limited = self._advance(
            craft,
            self._state,
            self._momentum,
            torque,
            dipole,
            self._surroundings,
            self.period_ns * 1e-9,
            self._torque,
        )
        check_rate(self._state.omega_bn_b)
        stamp_ns += self.period_ns
        self.finished = self.step_of(stamp_ns) >= self._steps
        return self._messages(stamp_ns, torque_limited, speed_limited)

    def _messages(self, stamp_ns: int, torque_limited: int, speed_limited: int) -> Outgoing:
        # kept, because the cycle that begins at this stamp needs it too
        self._surroundings = self._environment.at((stamp_ns - self.epoch_ns) * 1e-9)
        state, surroundings = self._state, self._surroundings
        messages: dict[str, Sample] = {
            "truth": self.message(
                "truth",
                stamp_ns,
                r_n=np.array(surroundings.r_n),
                v_n=np.array(surroundings.v_n),
                sigma_bn=np.array(state.sigma_bn),
                omega_bn_b=np.array(state.omega_bn_b),
                sun_n=np.array(surroundings.sun_n),
                field_n=np.array(surroundings.field_n),
                solar_flux=surroundings.solar_flux,
                illumination=surroundings.illumination,
            ),
        }
        if self.values[WHEELS_FITTED]:
            speed = np.zeros(len(self._momentum))
            self._wheel_speeds(self._craft.body, state.omega_bn_b, self._momentum, speed)
            wheels = {
                "speed_limited": speed_limited,
                "torque_limited": torque_limited,
                "torque": self._torque.copy(),
            }
            if "true_wheels" in self.frames:
                messages["true_wheels"] = self.message("true_wheels", stamp_ns, speed=speed.copy(), **wheels)
            self._report(self._tachometer, self._failing.table, self._key, self.step_of(stamp_ns), speed)
            messages["wheels"] = self.message("wheels", stamp_ns, speed=speed, **wheels)
        if self.values[_POSE]:
            # the quaternion that turns components in b into components in n, as ROS has it, is scalar-last that of
            # dcm_bn in the convention of css_common.attitude
            pose = np.array((*surroundings.r_n, *mrp_to_quaternion(state.sigma_bn)))
            messages["pose"] = self.message("pose", stamp_ns, pose=pose)
        return messages | self._failing.told(self, stamp_ns)


def _speeds_err(values: Values) -> bool:
    """Whether reported speeds may be other than the true ones."""
    return tachometer.errs(tachometer.parameters(values)) or values[failing.REPORT] or _tachometers_fail(values)


def _tachometers_fail(values: Values) -> bool:
    return any(line.startswith("tachometer.") for line in values[FAULTS])


main = node_main(Dynamics)
