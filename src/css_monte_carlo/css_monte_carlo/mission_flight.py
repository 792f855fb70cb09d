# SPDX-License-Identifier: Apache-2.0
"""A mission as the compiled loop flies it: which node plays which part, its parameters, the events that change them."""

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from css_analysis.flight_metrics import windows_of
from css_common.actuator_sections import wheel_axes
from css_common.mission import Event, Mission
from css_common.mission_node import Node
from css_common.random_streams import RandomKey, random_key
from css_common.schema import Values, default_values, shaped_values
from css_common.stepping import first_step
from css_common.vectors import Vec3
from css_environment.albedo import new_workspace
from css_environment.albedo_vector import MODELS
from css_environment.earth_light import new_light
from css_estimation.health import watched
from css_estimation.nodes.attitude_filter import AttitudeFilter
from css_estimation.nodes.earthlight import Earthlight
from css_estimation.sun.sky_table import aligned_table
from css_estimation.sun.sun_estimator import SunEstimator, hears_field, hears_wheels
from css_monte_carlo.attitude_guess import guessed_start
from css_monte_carlo.case_missions import case_mission, share_surroundings
from css_monte_carlo.case_tallies import step_marks
from css_monte_carlo.failing_units import uncertainty_of
from css_monte_carlo.loop import TRUTH_COLUMNS, Cases, CaseState, Vehicle
from css_monte_carlo.measures import ATTITUDE, HEADING
from css_monte_carlo.mission_parts import parts_of
from css_monte_carlo.surroundings import SurroundingsTables
from css_sensors.corrections import corrections
from css_sim import (
    actuator_faults,
    axis_faults,
    cell_errors,
    cell_faults,
    cell_screen,
    earth_reflectivity,
    gyro,
    initial_conditions,
    latency,
    magnetometer,
    orbit_dispersion,
    sun_cells,
    tachometer,
)
from css_sim.fault_effects import GYRO, MAGNETOMETER
from css_sim.faults import rows, with_held
from css_sim.nodes.magnetometer import Magnetometer
from css_sim.sensing import Sensors
from css_sim.spacecraft import spacecraft
from sunpoint_control.controller import Controller

_NOWHERE = (0.0, 0.0, 0.0)
_NO_GYRO = gyro.Gyro(math.nan, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Stretch(NamedTuple):
    """Steps between which nothing is switched."""

    first: int
    end: int  # the step after the last
    vehicle: Vehicle
    cases: Cases


class MissionFlight:
    """The flights of a mission, all cases of one configuration.

    Attributes:
        mission: what flies.
        steps: control cycles of a flight.
        measure: how the estimator of interest is measured.
        own_surroundings: cases differ in orbit, epoch or parameters, and each has flights of its own, `around_case`.
        surroundings: the environment that all cases share, or that of one case.
        marks: (steps,) what is special about each step, see `case_tallies.step_marks`.
    """

    def __init__(
        self, mission: Mission, estimator: str | None = None, surrounded_as: "MissionFlight | None" = None
    ) -> None:
        """Prepares what all cases share.

        Args:
            estimator: node whose estimates are measured, None: `graph.estimator`.
            surrounded_as: flights whose surroundings are those of this mission, too.

        Raises:
            NoPlace: the graph has a node, or the mission an event, that the compiled loop has no place for.
            MissionError: there is no such estimator.
        """
        self.mission = mission
        self.steps = mission.steps
        self._plant, self._array, self._control, self._gyro, self._magnetometer, self._heading, self._filter = parts_of(
            mission, estimator
        )
        self.measure = HEADING if self._filter is None else ATTITUDE
        array = self._array.values
        self._own_earth = array.albedo.enabled and array.albedo.draw != "mean"
        self._grid = earth_reflectivity.source(array, mission.epoch_ns) if array.albedo.enabled else None
        common = None
        if self._grid is not None:
            common = earth_reflectivity.case_reflectivity(array, self._grid, self._key(mission.values.mission.case))
        values = mission.values.mission
        self.own_places = orbit_dispersion.is_dispersed(self._plant.values) or values.epoch_spread_days > 0.0
        self.own_surroundings = self.own_places or bool(mission.dispersions)
        self._measured = estimator
        # an attitude filter is aided by references of its own, or as a Sun estimator is
        aided = self._filter is not None and getattr(_algorithm(self._filter), "AIDED_BY_SKY", False)
        self._aided = _values(self._filter) if aided else None
        self.surroundings: SurroundingsTables = (
            self._surroundings(common, aided) if surrounded_as is None else surrounded_as.surroundings
        )
        illumination = self.surroundings.states(0, self.steps)["illumination"]
        self.marks = step_marks(illumination, mission.period_ns * 1e-9, windows_of(mission))

    def _surroundings(self, common: np.ndarray | None, aided: bool) -> SurroundingsTables:
        array, values = self._array.values, self.mission.values.mission
        return SurroundingsTables(
            self._plant.values,
            _values(self._heading),
            None if aided else _values(self._filter),
            self._aided,
            common,
            self._own_earth,
            self.feels_field,
            MODELS[array.albedo.model],
            orbit_dispersion.case_orbit(self._plant.values, self._key(values.case)),
        )

    def around_case(self, case: int) -> "MissionFlight":
        """The flights of a case alone, where cases differ in their surroundings or parameters (`own_surroundings`).

        Its own draws are those of `mission.case` of its mission.

        Raises:
            MissionError: the case draws parameters that cannot fly.
        """
        mission = case_mission(self.mission, case)
        shared = not self.own_places and share_surroundings(self.mission.dispersions)
        return MissionFlight(mission, self._measured, self if shared else None)

    @property
    def trace_columns(self) -> int:
        """Columns of a trace: truth, the measured estimate, dipoles of the rods, torques and speeds of the wheels."""
        values = self._plant.values
        rods = len(values.rods.axes) if values.rods.fitted else 0
        return TRUTH_COLUMNS + self.measure.estimate_columns + rods + 2 * len(wheel_axes(values))

    def stretches(self, cases: Cases) -> Iterator[Stretch]:
        """The stretches between scripted events, in order."""
        begins = [first_step(event, self.mission.period_ns) for event in self.mission.events]
        bounds = sorted({0, *(b for b in begins if b < self.steps), self.steps})
        for first, end in pairwise(bounds):
            done = [event for event, begin in zip(self.mission.events, begins, strict=True) if begin <= first]
            before = cases
            cases = cases._replace(faults=self._faults(done, cases.numbers))
            for now, then in zip(cases.faults, before.faults, strict=True):
                with_held(now, then, self._begun_anew(done, first))
            yield Stretch(first, end, self._vehicle(done), cases)

    def cases(self, numbers: np.ndarray, guess_deg: float = 0.0) -> tuple[Cases, list[CaseState]]:
        """Tables and initial states of cases (C,).

        Args:
            guess_deg: if not 0, an attitude filter begins with an attitude that errs by so many degrees about each
                axis, 1 sigma, the same for every filter of a case; else as its parameters say.
        """
        array, plant = self._array.values, self._plant.values
        keys = [self._key(int(number)) for number in numbers]
        bodies = [initial_conditions.dispersed_body(plant, key) for key in keys]
        start = initial_conditions.parameters(plant)
        rotations = [initial_conditions.initial_state(start, key) for key in keys]
        nominal = cell_errors.nominal_cells(array.cells.normals, cell_screen.cell_sides(array))
        cells = np.tile(nominal, (len(keys), 1))
        model = cell_errors.error_model(array)
        for row, key in zip(cells, keys, strict=True):
            cell_errors.draw_cells(model, key, nominal, row)
        earths, motions, fields = np.zeros((0, 0, 0)), np.zeros((0, 3)), np.zeros((0, 0, 0, 0))
        if self._own_earth:
            assert self._grid is not None
            if earth_reflectivity.clouds_move(array):
                clouds = [earth_reflectivity.case_clouds(array, self._grid, key) for key in keys]
                motions = np.array([motion for motion, _ in clouds])
                fields = np.stack([of_case for _, of_case in clouds])
            earths = np.stack([earth_reflectivity.case_reflectivity(array, self._grid, key) for key in keys])
        momentum = np.stack(
            [
                initial_conditions.initial_wheel_momentum(body, rotation.omega_bn_b, plant.initial.wheel_speed_rpm)
                for body, rotation in zip(bodies, rotations, strict=True)
            ]
        )
        tables = Cases(
            seed_low=keys[0].seed_low,
            seed_high=keys[0].seed_high,
            numbers=np.array(numbers, dtype=np.uint32),
            inertia=np.array([body.inertia for body in bodies]),
            inertia_inverse=np.array([body.inertia_inverse for body in bodies]),
            dipole=np.array([initial_conditions.dispersed_dipole(plant, key) for key in keys]),
            wheels=np.stack([body.wheels for body in bodies]),
            wheel_momentum=momentum,
            torque=np.zeros_like(momentum),
            applied=np.zeros_like(momentum),
            speeds=np.zeros_like(momentum),
            rod_dipole=np.zeros((len(keys), len(plant.rods.axes) if plant.rods.fitted else 0)),
            voltages=np.zeros((len(keys), len(nominal))),
            corrected=np.zeros((len(keys), len(nominal))),
            healthy=np.zeros((len(keys), len(nominal))),
            rates=np.zeros((len(keys), 3)),
            cells=cells,
            faults=self._faults([], numbers),
            felt_wheels=np.stack([body.wheels for body in bodies]),
            felt_torque=np.zeros_like(momentum),
            felt_dipole=np.zeros((len(keys), len(plant.rods.axes) if plant.rods.fitted else 0)),
            reflectivity=earths,
            cloud_fields=fields,
            cloud_motion=motions,
            light=aligned_table(len(keys) if self._own_earth else 0, len(new_light())),
            albedo=np.zeros((len(keys), len(nominal))),
            work=aligned_table(len(keys), len(new_workspace())),
            history=np.stack([latency.new_history(max(map(latency.longest_lag, self._latencies())))] * len(keys)),
        )
        states = []
        for key, rotation in zip(keys, rotations, strict=True):
            attitude, memory = self._initial_attitude(key, rotation.sigma_bn, guess_deg)
            heading, heading_memory = self._initial_heading()
            control, of_control = self._initial_control()
            states.append(
                CaseState(rotation, heading, heading_memory, attitude, memory, control, of_control, _NOWHERE, -1)
            )
        return tables, states

    def _initial_heading(self) -> tuple[Any, Any]:
        """State and memory of the Sun estimator."""
        if self._heading is None:
            return None, None
        algorithm = _algorithm(self._heading)
        p = watched.watched_parameters(algorithm, self._heading.values)
        return watched.initial_state(algorithm, p), watched.initial_memory(algorithm, p)

    def _initial_control(self) -> tuple[Any, Any]:
        """State and memory of the control law."""
        if self._control is None:
            return None, None
        algorithm, p = _algorithm(self._control), _parameters(self._control, self._control.values)
        return algorithm.initial_state(p), algorithm.initial_memory(p)

    def _initial_attitude(self, key: RandomKey, sigma_bn: Vec3, guess_deg: float) -> tuple[Any, Any]:
        """State and memory of the attitude filter."""
        if self._filter is None:
            return None, None
        p = _parameters(self._filter, self._filter.values)
        if guess_deg > 0.0:
            p = p._replace(start=guessed_start(key, sigma_bn, guess_deg))
        algorithm = _algorithm(self._filter)
        return algorithm.initial_state(p), algorithm.initial_memory(p)

    def _vehicle(self, done: list[Event]) -> Vehicle:
        values = {node.name: self._values_after(node, done) for node in self.mission.nodes}
        plant, array = values[self._plant.name], values[self._array.name]
        heading, attitude, control = (
            None if node is None else values[node.name] for node in (self._heading, self._filter, self._control)
        )
        has_field = self._magnetometer is not None
        control_hears = has_field and control is not None and plant.rods.fitted
        heading_hears = has_field and heading is not None and hears_field(heading)
        attitude_hears = has_field and attitude is not None and (self._aided is None or hears_field(self._aided))
        is_heard = control_hears or heading_hears or attitude_hears
        x, y, z = (float(c) for c in plant.spacecraft.array_normal)
        return Vehicle(
            period_ns=self.mission.period_ns,
            sensors=self._sensors(values, done, is_heard),
            uncertainty=uncertainty_of(array),
            own_earth=self._own_earth,
            albedo_model=MODELS[array.albedo.model],
            clouds=earth_reflectivity.clouds(self._array.values, self._grid),
            heading_hears_field=heading_hears,
            control_hears_field=control_hears,
            attitude_hears_field=attitude_hears,
            heading_hears_wheels=heading is not None and hears_wheels(heading),
            attitude_hears_wheels=self._aided is not None and hears_wheels(self._aided),
            heading=self._heading_parameters(heading),
            attitude=_parameters(self._filter, attitude),
            heading_corrections=corrections(heading),
            attitude_corrections=corrections(attitude),
            control_corrections=corrections(control),
            control=_parameters(self._control, control),
            craft=spacecraft(plant, self._key(0), plant.substeps),
            tachometer=tachometer.parameters(plant),
            array_normal_b=(x, y, z),
        )

    def _heading_parameters(self, values: Values | None) -> Any:
        """Of the Sun estimator behind the health of its sensors, None without one."""
        if self._heading is None or values is None:
            return None
        return watched.watched_parameters(_algorithm(self._heading), values)

    def _sensors(self, values: dict[str, Values], done: list[Event], field_is_heard: bool) -> Sensors:
        array = values[self._array.name]
        # without a gyro there is no bias to estimate
        rates = gyro.parameters(values[self._gyro.name]) if self._gyro else _NO_GYRO
        field_values = values[self._magnetometer.name] if self._magnetometer else default_values(Magnetometer.table())
        of_cells, of_gyro, of_field = latencies = self._latencies()
        return Sensors(
            cells=sun_cells.parameters(array),
            earthlit=array.albedo.enabled,
            gyro=rates,
            gyro_on=_is_on(self._gyro, done),
            magnetometer=magnetometer.parameters(field_values),
            magnetometer_on=_is_on(self._magnetometer, done),
            field_divider=field_values.magnetometer.divider if field_is_heard else 0,
            late=any(latency.longest_lag(of_one) > 0.0 for of_one in latencies),
            cell_latency=of_cells,
            gyro_latency=of_gyro,
            gyro_since=self._on_since(self._gyro, done),
            field_latency=of_field,
            field_since=self._on_since(self._magnetometer, done),
        )

    def _on_since(self, sensor: Node | None, done: list[Event]) -> int:
        """Step at which a sensor was last switched on; 0: it was on from the first step."""
        switches = [] if sensor is None else [e for e in done if e.node == sensor.name and e.action != "set"]
        on, since = True, 0
        for event in switches:
            if event.action == "activate" and not on:
                since = first_step(event, self.mission.period_ns)
            on = event.action == "activate"
        return since

    def _latencies(self) -> list[latency.Latency]:
        """Of cells, gyro and magnetometer."""
        sensors = (self._array, self._gyro, self._magnetometer)
        return [latency.NO_LATENCY if node is None else latency.parameters(node.values) for node in sensors]

    @property
    def feels_field(self) -> bool:
        """Whether the magnetic field does something to the spacecraft or is measured."""
        plant = self._plant.values
        return self._magnetometer is not None or plant.rods.fitted or initial_conditions.has_dipole(plant)

    def _faults(self, done: list[Event], numbers: np.ndarray) -> np.ndarray:
        """The faults (C, F) of cases (C,) once scripted changes have been made."""
        array, plant = self._values_after(self._array, done), self._values_after(self._plant, done)
        of_axes = [
            (self._values_after(sensor, done), sort)
            for sensor, sort in ((self._gyro, "gyro"), (self._magnetometer, "magnetometer"))
            if sensor is not None
        ]
        return np.stack(
            [
                np.concatenate(
                    [
                        rows(cell_faults.case_faults(array, key)),
                        rows(actuator_faults.case_faults(plant, key)),
                        *(rows(axis_faults.case_faults(values, sort, key)) for values, sort in of_axes),
                    ]
                )
                for key in (self._key(int(number)) for number in numbers)
            ]
        )

    def _begun_anew(self, done: list[Event], step: int) -> set[int]:
        """Sorts of faulty units whose sensor is switched on at a step and knows nothing of before."""
        sensors = {GYRO: self._gyro, MAGNETOMETER: self._magnetometer}
        return {sort for sort, sensor in sensors.items() if step > 0 and self._on_since(sensor, done) == step}

    def _key(self, case: int) -> RandomKey:
        return random_key(self.mission.values.mission.seed, case)

    def _values_after(self, node: Node, done: list[Event]) -> Values:
        """Values of a node once scripted changes have been made."""
        canonical = dict(node.canonical)
        canonical |= {e.parameter: e.value for e in done if e.node == node.name and e.action == "set"}
        return shaped_values(node.component.table(), canonical)


def _values(node: Node | None) -> Values | None:
    return None if node is None else node.values


def _algorithm(node: Node) -> Any:
    """The module of the node of an estimator or a control law."""
    component = node.component
    assert issubclass(component, (SunEstimator, AttitudeFilter, Earthlight, Controller))
    return component.algorithm


def _parameters(node: Node | None, values: Values | None) -> Any:
    """Parameters of the algorithm of the node of an estimator or a control law, None without the node."""
    return None if node is None else _algorithm(node).parameters(values)


def _is_on(sensor: Node | None, done: list[Event]) -> bool:
    if sensor is None:
        return False
    switches = [event.action for event in done if event.node == sensor.name and event.action != "set"]
    return not switches or switches[-1] == "activate"
