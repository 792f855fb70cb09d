# SPDX-License-Identifier: Apache-2.0
"""Simulated spinning payload of a sounding rocket, the owner of simulated time."""

from collections.abc import Iterable, Mapping

import numpy as np

from css_common.attitude import dcm_to_mrp
from css_common.component import INERTIAL, Finding, Outgoing, Output, Plant, Received
from css_common.kernel import typed_call
from css_common.mission_node import Node
from css_common.mission_section import CASE, DURATION, PERIOD, SEED
from css_common.orbit_section import needed_of_orbit
from css_common.random_streams import random_key
from css_common.run import node_main
from css_common.schema import Values
from css_environment.orbit_checks import field_findings, orbit_findings
from css_msgs.msg import SpacecraftState
from css_sensors.payload import needed_of_payload
from css_sim import flight_environment
from css_sim.flight_environment import GEOMAGNETIC_FIELD
from css_sim.spinning_payload import payload_motion, payload_state


class Rocket(Plant):
    """Torque-free motion of a coning payload between its deployments, along its trajectory; publishes the truth."""

    shared = ("orbit", "payload", "lockstep")
    parameters = flight_environment.PARAMETERS

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        return (Output("truth", "truth", SpacecraftState, frame=INERTIAL),)

    @classmethod
    def needed(cls, values: Values) -> tuple[str, ...]:
        return (*needed_of_orbit(values), *needed_of_payload(values))

    @classmethod
    def preflight(cls, node: Node, graph: Mapping[str, Node]) -> Iterable[Finding]:
        yield from orbit_findings(node.values)
        if node.values[GEOMAGNETIC_FIELD]:
            yield from field_findings(node.values)

    def configure(self) -> None:
        values = self.values
        self._motion = payload_motion(values, self.epoch_ns, random_key(values[SEED], values[CASE]))
        self._environment = flight_environment.flight_environment(values)
        self._state, self._to_mrp = typed_call(payload_state), typed_call(dcm_to_mrp)
        self._steps = round(values[DURATION] / values[PERIOD])
        self.finished = False

    def begin(self) -> Outgoing:
        return self._truth(self.epoch_ns)

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        stamp_ns += self.period_ns
        self.finished = self.step_of(stamp_ns) >= self._steps
        return self._truth(stamp_ns)

    def _truth(self, stamp_ns: int) -> Outgoing:
        elapsed_s = (stamp_ns - self.epoch_ns) * 1e-9
        state, surroundings = self._state(self._motion, elapsed_s), self._environment.at(elapsed_s)
        return {
            "truth": self.message(
                "truth",
                stamp_ns,
                r_n=np.array(surroundings.r_n),
                v_n=np.array(surroundings.v_n),
                sigma_bn=np.array(self._to_mrp(state.dcm_bn)),
                omega_bn_b=np.array(state.omega_bn_b),
                sun_n=np.array(surroundings.sun_n),
                field_n=np.array(surroundings.field_n),
                solar_flux=surroundings.solar_flux,
                illumination=surroundings.illumination,
            )
        }


main = node_main(Rocket)
