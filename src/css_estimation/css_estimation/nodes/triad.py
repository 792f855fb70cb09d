# SPDX-License-Identifier: Apache-2.0
"""Attitude from the Sun, seen by the slits of a spinning body or by cells, and the magnetometer."""

from collections import deque
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from css_common.attitude import dcm_to_quaternion
from css_common.component import Component, Finding, Input, Outgoing, Output, Received, Standing
from css_common.health_report import HealthReport, health_output
from css_common.kernel import typed_call
from css_common.mission_node import Node
from css_common.orbit_section import needed_of_orbit
from css_common.run import node_main
from css_common.schema import Values, choice
from css_common.sensor_inputs import field_input
from css_common.vectors import Vec3, norm, vector_of
from css_environment.mission_environment import MissionEnvironment
from css_estimation.attitude import cell_sun, flight_references, sun_field_attitude
from css_estimation.attitude.sun_field_attitude import MODE_NONE, SunFieldAttitude
from css_estimation.health.cell_options import ENABLED
from css_estimation.messages import cells_input
from css_estimation.symmetric import Symmetric, isotropic
from css_msgs.msg import AttitudeEstimate, SlitSunAngle
from css_sensors.calibrated_readings import CalibratedReadings, temperature_findings, temperature_inputs

_SUN_SOURCE = choice(
    "sun_source",
    "auto",
    ("auto", "slits", "cells"),
    "what sees the Sun: slits at each passage, or the lit cells at each stamp; auto: cells where the mission has some",
)


def _is_by_cells(values: Values) -> bool:
    source = values[_SUN_SOURCE]
    return source == "cells" or (source == "auto" and len(values.cells.normals) > 0)


class _Sighting(NamedTuple):
    instant_ns: int
    sun_b: Vec3
    covariance: Symmetric
    rate: float  # [rad/s]


class _FieldSample(NamedTuple):
    stamp_ns: int
    field_b: Vec3
    variance: float  # [T^2]


class Triad(Component):
    """Attitude at each passage of the Sun, from its direction and the field at the same instant (TRIAD).

    Of cells it is that of each stamp at which lit cells tell the Sun. Of slits the field is interpolated between
    samples, so an attitude goes out two samples after its instant: it is that of `delay` before the stamp. References
    are the Sun's ephemeris and IGRF at the flight's position.
    """

    shared = ("orbit", "magnetometer", "cells")
    parameters = (flight_references.FIELD_DEGREE, *sun_field_attitude.PARAMETERS, _SUN_SOURCE, *cell_sun.PARAMETERS)

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        field = field_input(values, required=True)
        if _is_by_cells(values):
            return (cells_input(values), *temperature_inputs(values), field)
        return (Input("angle", "slit_sun_angle/sun_angle", SlitSunAngle), field)

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        attitude = Output("attitude", f"{name}/attitude", AttitudeEstimate, ends_cycle=True)
        return (attitude, health_output(name)) if _is_by_cells(values) and values[ENABLED] else (attitude,)

    @classmethod
    def needed(cls, values: Values) -> tuple[str, ...]:
        cells = ("cells.normals",) if _is_by_cells(values) else ()
        return (*cells, *needed_of_orbit(values))

    @classmethod
    def conflicts(cls, values: Values) -> Iterable[str]:
        sampling = values.mission.period * values.magnetometer.divider
        if not _is_by_cells(values) and sampling > 0.05:
            yield (
                f"magnetometer.divider: a sample every {sampling:g} s given, expected at most 0.05 s: the field of a "
                "spinning body is interpolated"
            )

    @classmethod
    def preflight(cls, node: Node, graph: Mapping[str, Node]) -> Iterable[Finding]:
        return temperature_findings(node.values, graph) if _is_by_cells(node.values) else ()

    def configure(self) -> None:
        self._environment = MissionEnvironment(
            self.values, field=True, field_degree=self.values[flight_references.FIELD_DEGREE]
        )
        self._spacing_ns = self.period_ns * self.values.magnetometer.divider
        self._p = sun_field_attitude.parameters(self.values)
        self._samples: deque[_FieldSample] = deque(maxlen=64)
        self._sightings: deque[_Sighting] = deque(maxlen=64)
        self._newest: dict[str, Any] | None = None
        self._instant_ns = 0
        self._calibrated = CalibratedReadings(self.values)
        self._cell_sun = cell_sun.CellSun(self.values) if _is_by_cells(self.values) else None
        self._health = HealthReport() if self._cell_sun is not None and self.values[ENABLED] else None
        self._last_stamp_ns: int | None = None
        self._attitude = typed_call(sun_field_attitude.measured_attitude)
        self._interpolated = typed_call(sun_field_attitude.interpolated_field)
        self._variance = typed_call(sun_field_attitude.interpolated_variance)
        self._quaternion = typed_call(dcm_to_quaternion)
        # compiled here, not at the first passage: the loop would wait
        field_b = (0.0, 1e-5, 0.0)
        self._interpolated(field_b, field_b, field_b, field_b, 0.5)
        self._variance(0.0, 1e-5, 0.1, 0.5)
        x = (1.0, 0.0, 0.0)
        attitude = self._attitude(self._p, x, isotropic(0.0), field_b, 1e-14, x, field_b)
        self._quaternion(attitude.dcm_bn)

    def standing(self) -> Standing:
        return Standing(self._calibrated.warning)

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        fresh = self._by_slits(stamp_ns, received) if self._cell_sun is None else self._by_cells(stamp_ns, received)
        isolated = 0 if self._cell_sun is None else self._cell_sun.isolated
        attitude = self.message("attitude", stamp_ns, isolated=isolated, **self._fields(stamp_ns, fresh))
        return {"attitude": attitude, **self._told_health(stamp_ns)}

    def _told_health(self, stamp_ns: int) -> Outgoing:
        if self._health is None or self._cell_sun is None:
            return {}
        return self._health.told(self, stamp_ns, self._cell_sun.verdicts, self._cell_sun.cycles)

    def _by_cells(self, stamp_ns: int, received: Received) -> bool:
        """The attitude of a stamp at which field and cells tell one; True when they do."""
        cells, field = received["cells"], received["field"]
        assert cells is not None and self._cell_sun is not None  # required inputs
        since_ns = 0 if self._last_stamp_ns is None else stamp_ns - self._last_stamp_ns
        self._last_stamp_ns = stamp_ns
        at = self._environment.at((stamp_ns - self.epoch_ns) * 1e-9)
        voltages = self._cell_sun.trusted(
            self._calibrated.cells(cells.voltages, received.get("temperature")), since_ns * 1e-9, at
        )
        field_b, valid = self._calibrated.field(field)
        if field is None or not valid:
            return False
        seen = self._cell_sun.seen(voltages, field_b, at)
        if seen is None:
            return False
        # a covariance of zeros is one that nobody knows
        variance = max(float(field.magnetic_field_covariance[0]), self._cell_sun.field_variance)
        attitude = self._attitude(self._p, seen.sun_b, seen.covariance, field_b, variance, at.sun_n, at.field_n)
        return self._take(attitude, stamp_ns, 0.0, seen.mask)

    def _by_slits(self, stamp_ns: int, received: Received) -> bool:
        angle = received["angle"]
        assert angle is not None  # a required input
        if received["field"] is not None:
            field_b, valid = self._calibrated.field(received["field"])
            if valid:
                variance = max(float(received["field"].magnetic_field_covariance[0]), 0.0)
                self._samples.append(_FieldSample(stamp_ns, field_b, variance))
        if angle.validity == SlitSunAngle.VALIDITY_VALID:
            c = angle.covariance.tolist()
            covariance = (c[0], c[1], c[2], c[4], c[5], c[8])
            instant_ns = stamp_ns - round(angle.age * 1e9)
            self._sightings.append(_Sighting(instant_ns, vector_of(angle.sun_b), covariance, angle.rate))
        return self._settle(stamp_ns)

    def _settle(self, stamp_ns: int) -> bool:
        """The attitude of the oldest sighting whose field is known by now; True when there is a new one."""
        while self._sightings and stamp_ns >= self._sightings[0].instant_ns + 2 * self._spacing_ns:
            sighting = self._sightings.popleft()
            around = self._around(sighting.instant_ns)
            if around is not None and self._solve(sighting, around):
                return True
        return False

    def _around(self, instant_ns: int) -> list[_FieldSample] | None:
        """Two samples before an instant and two after it; None when one of them was not measured."""
        first = -(-(instant_ns - self.epoch_ns) // self._spacing_ns) - 2
        stamps = [self.epoch_ns + (first + i) * self._spacing_ns for i in range(4)]
        by_stamp = {sample.stamp_ns: sample for sample in self._samples}
        return [by_stamp[stamp] for stamp in stamps] if all(stamp in by_stamp for stamp in stamps) else None

    def _solve(self, sighting: _Sighting, around: list[_FieldSample]) -> bool:
        u = (sighting.instant_ns - around[1].stamp_ns) / self._spacing_ns
        before, left, right, after = (sample.field_b for sample in around)
        field_b = self._interpolated(before, left, right, after, u)
        turn = sighting.rate * self._spacing_ns * 1e-9
        variance = self._variance(max(sample.variance for sample in around), norm(field_b), turn, u)
        at = self._environment.at((sighting.instant_ns - self.epoch_ns) * 1e-9)
        attitude = self._attitude(self._p, sighting.sun_b, sighting.covariance, field_b, variance, at.sun_n, at.field_n)
        return self._take(attitude, sighting.instant_ns, sighting.rate, 0)

    def _take(self, attitude: SunFieldAttitude, instant_ns: int, rate: float, lit_mask: int) -> bool:
        """Makes an attitude the newest one, unless there is none."""
        if attitude.mode == MODE_NONE:
            return False
        xx, xy, xz, yy, yz, zz = attitude.covariance
        covariance = np.zeros((6, 6))
        covariance[:3, :3] = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
        self._instant_ns = instant_ns
        self._newest = {
            "q_bn": np.array(self._quaternion(attitude.dcm_bn)),
            "omega_bn_b": np.array((0.0, 0.0, rate)),
            "gyro_bias_b": np.zeros(3),
            "covariance": covariance.ravel(),
            "nis": attitude.nis,
            "lit_mask": lit_mask,
            "nis_dof": 1,
            "used": AttitudeEstimate.USED_FIELD | AttitudeEstimate.USED_SUN,
            "mode": attitude.mode,
        }
        return True

    def _fields(self, stamp_ns: int, fresh: bool) -> dict[str, Any]:
        if self._newest is None:
            no_covariance = np.zeros(36)
            no_covariance[0] = -1.0
            vectors = {"q_bn": np.zeros(4), "omega_bn_b": np.zeros(3), "gyro_bias_b": np.zeros(3)}
            numbers = dict.fromkeys(("lit_mask", "nis_dof", "used", "mode"), 0)
            validity = AttitudeEstimate.VALIDITY_NONE
            return {
                **vectors,
                **numbers,
                "covariance": no_covariance,
                "age": 0.0,
                "delay": 0.0,
                "nis": 0.0,
                "validity": validity,
            }
        age = (stamp_ns - self._instant_ns) * 1e-9
        return {
            **self._newest,
            "age": age,
            "delay": age,
            "validity": AttitudeEstimate.VALIDITY_VALID if fresh else AttitudeEstimate.VALIDITY_HELD,
        }


main = node_main(Triad)
