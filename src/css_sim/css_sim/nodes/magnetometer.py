# SPDX-License-Identifier: Apache-2.0
"""Simulated magnetometer."""

from collections.abc import Iterable, Mapping

import numpy as np
from sensor_msgs.msg import MagneticField

from css_common.attitude import mrp_to_dcm
from css_common.codec import Sample
from css_common.component import INERTIAL, Component, Finding, Input, Outgoing, Output, Received
from css_common.mission import Node
from css_common.random_streams import random_key
from css_common.run import node_main
from css_common.schema import Values
from css_common.sections import CASE, FIELD_DIVIDER, SEED
from css_common.vectors import vector_of
from css_msgs.msg import SpacecraftState
from css_sim import latency, magnetometer
from css_sim.delayed import Delayed
from css_sim.latency import Moment
from css_sim.sensing import sense_field
from css_sim.sensor_checks import LOUDEST_FIELD_NT, noise_findings

_NOTHING = np.array([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


class Magnetometer(Component):
    """Geomagnetic field in the body frame with bias and noise, every `magnetometer.divider` cycles.

    Deactivated, it says for every stamp that is due that it has no measurement (covariance -1).
    """

    shared = ("magnetometer",)
    parameters = (*magnetometer.PARAMETERS, *latency.PARAMETERS)

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        return (Input("truth", "truth", SpacecraftState, frame=INERTIAL, used=("sigma_bn", "field_n")),)

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        return (Output("field", "mag/field", MagneticField, divider=values[FIELD_DIVIDER]),)

    @classmethod
    def conflicts(cls, values: Values) -> Iterable[str]:
        return latency.conflicts(values)

    @classmethod
    def preflight(cls, node: Node, graph: Mapping[str, Node]) -> Iterable[Finding]:
        return noise_findings(magnetometer.NOISE, node.values, LOUDEST_FIELD_NT)

    def configure(self) -> None:
        self._key = random_key(self.values[SEED], self.values[CASE])
        self._p = magnetometer.parameters(self.values)
        self._bias_b = magnetometer.draw_bias(self._p, self._key)
        self._delayed = Delayed(latency.parameters(self.values), self._key, latency.MAGNETOMETER)
        self._covariance = (magnetometer.variance(self._p) * np.eye(3)).ravel()

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        step = self.step_of(stamp_ns)
        there = self._there(step, received["truth"])
        if not self._is_due(step):
            return {}
        measured = sense_field(self._p, self._bias_b, self._key, step, mrp_to_dcm(there.sigma_bn), there.field_n)
        return self._field(stamp_ns, np.array(measured), self._covariance)

    def _there(self, step: int, truth: Sample) -> Moment:
        return self._delayed(step, sigma_bn=vector_of(truth.sigma_bn), field_n=vector_of(truth.field_n))

    def idle(self, stamp_ns: int, received: Received) -> Outgoing:
        return self._field(stamp_ns, np.zeros(3), _NOTHING) if self._is_due(self.step_of(stamp_ns)) else {}

    def _is_due(self, step: int) -> bool:
        return step % self.values[FIELD_DIVIDER] == 0

    def _field(self, stamp_ns: int, field_b: np.ndarray, covariance: np.ndarray) -> Outgoing:
        return {"field": self.message("field", stamp_ns, magnetic_field=field_b, magnetic_field_covariance=covariance)}


main = node_main(Magnetometer)

if __name__ == "__main__":
    raise SystemExit(main())
