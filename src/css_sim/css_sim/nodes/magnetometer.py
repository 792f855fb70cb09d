# SPDX-License-Identifier: Apache-2.0
"""Simulated magnetometer."""

from collections.abc import Iterable, Mapping

import numpy as np
from sensor_msgs.msg import MagneticField

from css_common.attitude import mrp_to_dcm
from css_common.case_faults import CaseFault
from css_common.codec import Sample
from css_common.component import INERTIAL, Component, Finding, Input, Outgoing, Output, Received
from css_common.fault_lines import FAULTS, Units
from css_common.mission_node import Node
from css_common.mission_section import CASE, SEED
from css_common.random_streams import random_key
from css_common.run import node_main
from css_common.schema import Values
from css_common.sections import FIELD_DIVIDER
from css_common.vectors import vector_of
from css_msgs.msg import SpacecraftState
from css_sim import axis_faults, failing, latency, magnetometer
from css_sim.delayed import Delayed
from css_sim.failing import Failing, fault_outputs
from css_sim.fault_effects import MAGNETOMETER, is_silent
from css_sim.latency import Moment
from css_sim.sensing import sense_field
from css_sim.sensor_checks import LOUDEST_FIELD_NT, noise_findings

_NOTHING = np.array([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


class Magnetometer(Component):
    """Geomagnetic field in the body frame with bias and noise, every `magnetometer.divider` cycles.

    Deactivated, it says for every stamp that is due that it has no measurement (covariance -1).
    """

    shared = ("magnetometer",)
    parameters = (*magnetometer.PARAMETERS, *latency.PARAMETERS, *failing.PARAMETERS)
    fault_kinds = axis_faults.MAGNETOMETER_KINDS
    _failing = Failing(())  # of a node that has not begun

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        return (Input("truth", "truth", SpacecraftState, frame=INERTIAL, used=("sigma_bn", "field_n")),)

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        return (
            Output("field", "mag/field", MagneticField, divider=values[FIELD_DIVIDER]),
            *fault_outputs(name, values),
        )

    @classmethod
    def fault_units(cls, values: Values) -> Units:
        return axis_faults.units("magnetometer")

    @classmethod
    def conflicts(cls, values: Values) -> Iterable[str]:
        return latency.conflicts(values)

    @classmethod
    def preflight(cls, node: Node, graph: Mapping[str, Node]) -> Iterable[Finding]:
        return noise_findings(magnetometer.NOISE, node.values, LOUDEST_FIELD_NT)

    def configure(self) -> None:
        self._key = random_key(self.values[SEED], self.values[CASE])
        self._faults = axis_faults.of_case(self.values, "magnetometer", self._key)
        self._failing = Failing(self._case_faults(), self._failing)
        self._take_noise()
        self._bias_b = magnetometer.draw_bias(self._p, self._key)
        self._delayed = Delayed(latency.parameters(self.values), self._key, latency.MAGNETOMETER)

    def tune(self, values: Values) -> None:
        super().tune(values)
        self._take_noise()
        self._failing.take(self._case_faults())

    def _take_noise(self) -> None:
        self._p = magnetometer.parameters(self.values)
        self._covariance = (magnetometer.variance(self._p) * np.eye(3)).ravel()

    def _case_faults(self) -> list[CaseFault]:
        return self._faults.of(self.values[FAULTS])

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        step = self.step_of(stamp_ns)
        there = self._there(step, received["truth"])
        told = self._failing.told(self, stamp_ns)
        if not self._is_due(step):
            return told
        faults = self._failing.table
        if is_silent(faults, MAGNETOMETER, step):
            return self._field(stamp_ns, np.zeros(3), _NOTHING) | told
        dcm_bn = mrp_to_dcm(there.sigma_bn)
        measured = sense_field(self._p, self._bias_b, faults, self._key, step, dcm_bn, there.field_n)
        return self._field(stamp_ns, np.array(measured), self._covariance) | told

    def _there(self, step: int, truth: Sample) -> Moment:
        return self._delayed(step, sigma_bn=vector_of(truth.sigma_bn), field_n=vector_of(truth.field_n))

    def idle(self, stamp_ns: int, received: Received) -> Outgoing:
        told = self._failing.told(self, stamp_ns)
        return self._field(stamp_ns, np.zeros(3), _NOTHING) | told if self._is_due(self.step_of(stamp_ns)) else told

    def _is_due(self, step: int) -> bool:
        return step % self.values[FIELD_DIVIDER] == 0

    def _field(self, stamp_ns: int, field_b: np.ndarray, covariance: np.ndarray) -> dict[str, Sample]:
        return {"field": self.message("field", stamp_ns, magnetic_field=field_b, magnetic_field_covariance=covariance)}


main = node_main(Magnetometer)
