# SPDX-License-Identifier: Apache-2.0
"""Simulated rate gyro."""

from collections.abc import Iterable, Mapping

import numpy as np
from sensor_msgs.msg import Imu

from css_common.case_faults import CaseFault
from css_common.codec import Sample
from css_common.component import INERTIAL, Component, Finding, Input, Outgoing, Output, Received
from css_common.fault_lines import FAULTS, Units
from css_common.kernel import typed_call
from css_common.mission_node import Node
from css_common.mission_section import CASE, SEED
from css_common.random_streams import random_key
from css_common.run import node_main
from css_common.schema import Values
from css_common.vectors import vector_of
from css_msgs.msg import SpacecraftState
from css_sim import axis_faults, failing, gyro, latency
from css_sim.delayed import Delayed
from css_sim.failing import Failing, fault_outputs
from css_sim.fault_effects import GYRO, is_silent
from css_sim.sensor_checks import LOUDEST_GYRO_DEG_S, noise_findings

_NOTHING = np.array([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
_ZERO = np.zeros(3)
_NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])


class Gyro(Component):
    """Body rates with bias and noise. Deactivated, it says for every stamp that it has no estimate (covariance -1)."""

    shared = ()
    parameters = (*gyro.PARAMETERS, *latency.PARAMETERS, *failing.PARAMETERS)
    fault_kinds = axis_faults.GYRO_KINDS
    _failing = Failing(())  # of a node that has not begun

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        return (Input("truth", "truth", SpacecraftState, frame=INERTIAL, used=("omega_bn_b",)),)

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        return (Output("imu", "gyro/imu", Imu), *fault_outputs(name, values))

    @classmethod
    def fault_units(cls, values: Values) -> Units:
        return axis_faults.units("gyro")

    @classmethod
    def conflicts(cls, values: Values) -> Iterable[str]:
        return latency.conflicts(values)

    @classmethod
    def preflight(cls, node: Node, graph: Mapping[str, Node]) -> Iterable[Finding]:
        return noise_findings(gyro.NOISE, node.values, LOUDEST_GYRO_DEG_S)

    def configure(self) -> None:
        self._key = random_key(self.values[SEED], self.values[CASE])
        self._faults = axis_faults.of_case(self.values, "gyro", self._key)
        self._failing = Failing(self._case_faults(), self._failing)
        self._take_noise()
        self._errors = gyro.draw_errors(self._p, self._key)
        self._measure = typed_call(gyro.measure)
        self._delayed = Delayed(latency.parameters(self.values), self._key, latency.GYRO)

    def tune(self, values: Values) -> None:
        super().tune(values)
        self._take_noise()
        self._failing.take(self._case_faults())

    def _take_noise(self) -> None:
        self._p = gyro.parameters(self.values)
        self._covariance = (gyro.variance(self._p) * np.eye(3)).ravel()

    def _case_faults(self) -> list[CaseFault]:
        return self._faults.of(self.values[FAULTS])

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        step = self.step_of(stamp_ns)
        omega_bn_b = self._delayed(step, omega_bn_b=vector_of(received["truth"].omega_bn_b)).omega_bn_b
        told = self._failing.told(self, stamp_ns)
        if is_silent(self._failing.table, GYRO, step):
            return self._imu(stamp_ns, _ZERO, _NOTHING) | told
        rate = self._measure(self._p, self._errors, self._failing.table, self._key, step, omega_bn_b)
        return self._imu(stamp_ns, np.array(rate), self._covariance) | told

    def idle(self, stamp_ns: int, received: Received) -> Outgoing:
        return self._imu(stamp_ns, _ZERO, _NOTHING) | self._failing.told(self, stamp_ns)

    def _imu(self, stamp_ns: int, rate: np.ndarray, covariance: np.ndarray) -> dict[str, Sample]:
        imu = self.message(
            "imu",
            stamp_ns,
            orientation=_NO_TURN,
            orientation_covariance=_NOTHING,
            angular_velocity=rate,
            angular_velocity_covariance=covariance,
            linear_acceleration=_ZERO,
            linear_acceleration_covariance=_NOTHING,
        )
        return {"imu": imu}


main = node_main(Gyro)
