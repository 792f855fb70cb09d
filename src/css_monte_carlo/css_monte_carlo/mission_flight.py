# SPDX-License-Identifier: Apache-2.0
"""A mission as the compiled loop flies it: which node plays which part, its parameters, the events that change them."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Literal, NamedTuple, overload

import numpy as np

from css_analysis.flight_metrics import windows_of
from css_common.component import Component
from css_common.mission import Event, Mission, MissionError, Node
from css_common.random_streams import RandomKey, random_key
from css_common.schema import Values, default_values, shaped_values
from css_common.stepping import first_step
from css_environment.albedo import new_workspace
from css_environment.albedo_vector import MODELS
from css_environment.earth_light import new_light
from css_estimation.sun.sun_algorithm import SunAlgorithm
from css_estimation.sun.sun_estimator import SunEstimator
from css_monte_carlo.case_tallies import step_marks
from css_monte_carlo.loop import Cases, CaseState, Vehicle
from css_monte_carlo.surroundings import SurroundingsTables, aligned_table
from css_sim import (
    cell_errors,
    cell_faults,
    cell_screen,
    earth_reflectivity,
    gyro,
    initial_conditions,
    magnetometer,
    sun_cells,
)
from css_sim.nodes.css_array import CssArray
from css_sim.nodes.dynamics import Dynamics
from css_sim.nodes.gyro import Gyro
from css_sim.nodes.magnetometer import Magnetometer
from css_sim.spacecraft import spacecraft
from sunpoint_control import sun_pointing_control
from sunpoint_control.nodes.mrp_control import MrpControl

_NOWHERE = (0.0, 0.0, 0.0)


class Stretch(NamedTuple):
    """Steps between which nothing is switched."""

    first: int
    end: int  # the step after the last
    vehicle: Vehicle
    cases: Cases


_FLOWN = {
    Dynamics: "css_sim/dynamics",
    CssArray: "css_sim/css_array",
    MrpControl: "sunpoint_control/mrp_control",
}


def refuse_uncovered(mission: Mission) -> None:
    """Looks whether the compiled loop has a place for a mission, before anything of it is changed.

    Raises:
        MissionError: it has none.
    """
    kinds = [node.component for node in mission.nodes]
    estimators = [node.name for node in mission.nodes if issubclass(node.component, SunEstimator)]
    missing = [name for kind, name in _FLOWN.items() if kind not in kinds]
    if missing or not estimators:
        lacks = ", ".join([*missing, *([] if estimators else ["a Sun estimator"])])
        raise MissionError(
            f"{mission.origin}: the Monte Carlo does not cover this mission: graph.nodes has no {lacks}; "
            "fly it on the graph"
        )


class MissionFlight:
    """The flights of a mission, all cases of one configuration.

    Attributes:
        mission: what flies.
        steps: control cycles of a flight.
        surroundings: the environment that all cases share.
        marks: (steps,) what is special about each step, see `case_figures.step_marks`.

    Raises:
        MissionError: the graph has a node, or the mission an event, that the compiled loop has no place for.
    """

    def __init__(self, mission: Mission) -> None:
        self.mission = mission
        self.steps = mission.steps
        self._plant = self._part(Dynamics)
        self._array = self._part(CssArray)
        self._control = self._part(MrpControl)
        self._gyro = self._part(Gyro, required=False)
        self._magnetometer = self._part(Magnetometer, required=False)
        self._estimator = mission.node(mission.values.graph.estimator)
        if not issubclass(self._estimator.component, SunEstimator):
            raise self._error(f"graph.estimator: {self._estimator.name} is no Sun estimator")
        known = (Dynamics, CssArray, MrpControl, Gyro, Magnetometer, SunEstimator)
        for node in mission.nodes:
            if not issubclass(node.component, known):
                raise self._error(f"the Monte Carlo has no place for the node {node.name}; fly it on the graph")
        self._check_events()
        array = self._array.values
        self._own_earth = array.albedo.enabled and array.albedo.draw != "mean"
        self._grid = earth_reflectivity.source(array, mission.epoch_ns) if array.albedo.enabled else None
        common = None
        if self._grid is not None:
            common = earth_reflectivity.case_reflectivity(array, self._grid, self._key(mission.values.mission.case))
        self.surroundings = SurroundingsTables(
            self._plant.values,
            self._estimator.values,
            common,
            self._own_earth,
            self._feels_field(),
            MODELS[array.albedo.model],
        )
        illumination = self.surroundings.states(0, self.steps)["illumination"]
        self.marks = step_marks(illumination, mission.period_ns * 1e-9, windows_of(mission))

    def stretches(self, cases: Cases) -> Iterator[Stretch]:
        """The stretches between scripted events, in order."""
        begins = [first_step(event, self.mission.period_ns) for event in self.mission.events]
        bounds = sorted({0, *(b for b in begins if b < self.steps), self.steps})
        for first, end in pairwise(bounds):
            done = [event for event, begin in zip(self.mission.events, begins, strict=True) if begin <= first]
            array = self._values_after(self._array, done)
            yield Stretch(first, end, self._vehicle(done), cases._replace(faults=self._faults(array, cases.numbers)))

    def cases(self, numbers: np.ndarray) -> tuple[Cases, list[CaseState]]:
        """Tables and initial states of cases (C,)."""
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
        earths = np.zeros((0, 0, 0))
        if self._own_earth:
            assert self._grid is not None
            earths = np.stack([earth_reflectivity.case_reflectivity(array, self._grid, key) for key in keys])
        estimator = self._algorithm.initial_state(self._algorithm.parameters(self._estimator.values))
        control = sun_pointing_control.initial_state(sun_pointing_control.parameters(self._control.values))
        tables = Cases(
            seed_low=keys[0].seed_low,
            seed_high=keys[0].seed_high,
            numbers=np.array(numbers, dtype=np.uint32),
            inertia=np.array([body.inertia for body in bodies]),
            inertia_inverse=np.array([body.inertia_inverse for body in bodies]),
            wheels=np.stack([body.wheels for body in bodies]),
            wheel_momentum=np.stack(
                [
                    initial_conditions.initial_wheel_momentum(body, rotation.omega_bn_b, plant.initial.wheel_speed_rpm)
                    for body, rotation in zip(bodies, rotations, strict=True)
                ]
            ),
            cells=cells,
            faults=self._faults(array, numbers),
            reflectivity=earths,
            light=aligned_table(len(keys) if self._own_earth else 0, len(new_light())),
            work=aligned_table(len(keys), len(new_workspace())),
        )
        return tables, [CaseState(rotation, estimator, control, _NOWHERE, -1) for rotation in rotations]

    @property
    def _algorithm(self) -> SunAlgorithm:
        component = self._estimator.component
        assert issubclass(component, SunEstimator)
        return component.algorithm

    def _vehicle(self, done: list[Event]) -> Vehicle:
        values = {node.name: self._values_after(node, done) for node in self.mission.nodes}
        plant, array = values[self._plant.name], values[self._array.name]
        craft = spacecraft(plant, self._key(0), plant.substeps)
        gyro_values = values[self._gyro.name] if self._gyro else default_values(Gyro.table())
        field_values = values[self._magnetometer.name] if self._magnetometer else default_values(Magnetometer.table())
        has_field = self._magnetometer is not None
        control_hears = has_field and plant.rods.fitted
        estimator_hears = has_field and values[self._estimator.name].rate.use_field
        x, y, z = (float(c) for c in plant.spacecraft.array_normal)
        return Vehicle(
            period_ns=self.mission.period_ns,
            cells=sun_cells.parameters(array),
            albedo=array.albedo.enabled,
            own_earth=self._own_earth,
            albedo_model=MODELS[array.albedo.model],
            gyro=gyro.parameters(gyro_values),
            gyro_on=_is_on(self._gyro, done),
            magnetometer=magnetometer.parameters(field_values),
            magnetometer_on=_is_on(self._magnetometer, done),
            field_divider=field_values.magnetometer.divider if control_hears or estimator_hears else 0,
            estimator_hears_field=estimator_hears,
            control_hears_field=control_hears,
            estimator=self._algorithm.parameters(values[self._estimator.name]),
            control=sun_pointing_control.parameters(values[self._control.name]),
            disturbances=craft.disturbances,
            disturbed=craft.disturbed,
            rod_axes_b=craft.rod_axes_b,
            rod_max_dipole=craft.rod_max_dipole,
            substeps=plant.substeps,
            array_normal_b=(x, y, z),
        )

    def _feels_field(self) -> bool:
        plant = self._plant.values
        return self._magnetometer is not None or plant.rods.fitted or bool(np.any(plant.disturbances.dipole))

    def _faults(self, array: Values, numbers: np.ndarray) -> np.ndarray:
        return np.stack([cell_faults.case_faults(array, self._key(int(number))) for number in numbers])

    def _key(self, case: int) -> RandomKey:
        return random_key(self.mission.values.mission.seed, case)

    def _error(self, reason: str) -> MissionError:
        return MissionError(f"{self.mission.origin}: {reason}")

    @overload
    def _part(self, component: type[Component]) -> Node: ...

    @overload
    def _part(self, component: type[Component], required: Literal[False]) -> Node | None: ...

    def _part(self, component: type[Component], required: bool = True) -> Node | None:
        nodes = [node for node in self.mission.nodes if node.component is component]
        if len(nodes) > 1:
            raise self._error(f"{nodes[0].name} and {nodes[1].name} are both {component.__name__}; expected one")
        if required and not nodes:
            raise self._error(f"no node of graph.nodes is {component.__name__}, which the Monte Carlo needs")
        return nodes[0] if nodes else None

    def _check_events(self) -> None:
        switched = [node.name for node in (self._gyro, self._magnetometer) if node is not None]
        for event in self.mission.events:
            if event.action != "set" and event.node not in switched:
                allowed = ", ".join(switched) or "none"
                raise self._error(
                    f"events.{event.name}: the Monte Carlo switches sensors alone, here {allowed}; fly it on the graph"
                )

    def _values_after(self, node: Node, done: list[Event]) -> Values:
        """Values of a node once scripted changes have been made."""
        canonical = dict(node.canonical)
        canonical |= {e.parameter: e.value for e in done if e.node == node.name and e.action == "set"}
        return shaped_values(node.component.table(), canonical)


def _is_on(sensor: Node | None, done: list[Event]) -> bool:
    if sensor is None:
        return False
    switches = [event.action for event in done if event.node == sensor.name and event.action != "set"]
    return not switches or switches[-1] == "activate"
