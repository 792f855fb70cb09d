# SPDX-License-Identifier: Apache-2.0
"""A mission without control as the compiled loop of attitude filters flies it: parts, parameters, cases."""

import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numba.typed
import numpy as np

from css_analysis.flight_metrics import windows_of
from css_common.attitude import mrp_add, rotation_vector_to_mrp
from css_common.component import Component
from css_common.mission import Mission, MissionError, Node
from css_common.random_streams import RandomKey, Stream, normal4, random_key
from css_common.vectors import Vec3
from css_environment.albedo import new_workspace
from css_environment.albedo_vector import MODELS
from css_estimation.attitude import attitude_options, attitude_solution
from css_estimation.attitude.attitude_options import AttitudeParameters, GivenStart
from css_estimation.attitude.flight_references import FlightReferences
from css_estimation.nodes.attitude_filter import AttitudeFilter
from css_monte_carlo.attitude_loop import (
    REFERENCE,
    TRACE_COLUMNS,
    FilterModel,
    FilterRun,
    Sensors,
    Tumbler,
    fly_attitude_block,
)
from css_monte_carlo.attitude_tallies import AttitudeTallies, new_tallies
from css_monte_carlo.surroundings import BLOCK_STEPS, SurroundingsTables, aligned_table
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

_CHUNK_CASES = 10
_PARTS = (Dynamics, CssArray, Gyro, Magnetometer, AttitudeFilter)


class FlownAttitudes(NamedTuple):
    """What cases gave."""

    tallies: AttitudeTallies
    trace: np.ndarray  # (C, filters, steps, columns), see `attitude_loop.TRACE`; empty unless asked for


def guessed_start(key: RandomKey, sigma_bn: Vec3, guess_deg: float) -> GivenStart:
    """A start beside the true attitude, by a draw of `guess_deg` [deg] about each axis, 1 sigma."""
    sigma = math.radians(guess_deg)
    x, y, z, _ = normal4(key, Stream.ATTITUDE_GUESS, 0, 0)
    guess = mrp_add(sigma_bn, rotation_vector_to_mrp((sigma * x, sigma * y, sigma * z)))
    return GivenStart(True, guess, sigma**2)


class AttitudeFlight:
    """The flights of a mission with attitude filters and without control.

    Attributes:
        mission: what flies.
        filters: names of the attitude filters, in the order of the graph.

    Raises:
        MissionError: the graph has a node or the mission an event or an actuator that this loop has no place for.
    """

    def __init__(self, mission: Mission) -> None:
        self.mission = mission
        for node in mission.nodes:
            if node.component not in _PARTS:
                raise self._error(f"attitude studies have no place for the node {node.name}; fly it on the graph")
        if mission.events:
            raise self._error("attitude studies have no place for events; fly them on the graph")
        nodes = [node for node in mission.nodes if node.component is AttitudeFilter]
        if not nodes:
            raise self._error("graph.nodes: no css_estimation/attitude_filter, which attitude studies need")
        self.filters = [node.name for node in nodes]
        self._plant, self._array, self._gyro = self._part(Dynamics), self._part(CssArray), self._part(Gyro)
        plant, array = self._plant.values, self._array.values
        if plant.wheels.fitted or plant.rods.fitted:
            raise self._error("wheels.fitted, rods.fitted: attitude studies fly without, expected false")
        if array.albedo.enabled and array.albedo.draw != "mean":
            raise self._error(f"css_array: albedo.draw: {array.albedo.draw} given, expected mean")
        earth = None
        if array.albedo.enabled:
            key = random_key(mission.values.mission.seed, mission.values.mission.case)
            grid = earth_reflectivity.source(array, mission.epoch_ns)
            earth = earth_reflectivity.case_reflectivity(array, grid, key)
        self._surroundings = SurroundingsTables(plant, None, earth, albedo_model=MODELS[array.albedo.model])
        self._sensors = self._common_sensors()
        self._models = [self._model(node) for node in nodes]

    def fly(
        self, numbers: np.ndarray, sample_every: int = 1, guess_deg: float = 0.0, traced: bool = False
    ) -> FlownAttitudes:
        """Flies cases (C,), each independent of the others.

        Args:
            guess_deg: if not 0, filters begin with an attitude that errs by so many degrees about each axis, 1 sigma,
                the same for all filters of a case; else as their parameters say.
            sample_every: steps from sample to sample.
            traced: keep the values of every step.
        """
        steps, filters = self.mission.steps, len(self.filters)
        settled = windows_of(self.mission).settled_time
        tallies = new_tallies(filters, len(numbers), steps, self.mission.period_ns * 1e-9, sample_every, settled)
        trace = np.zeros((len(numbers), filters, steps, TRACE_COLUMNS) if traced else (len(numbers), 0, 0, 0))
        models = numba.typed.List(self._models)
        for c, number in enumerate(numbers):
            case, rotation = self._case(int(number))
            runs = numba.typed.List(
                [
                    FilterRun(attitude_solution.initial_state(p), attitude_solution.initial_memory(p))
                    for p in (self._begun(m.parameters, case.key, rotation.sigma_bn, guess_deg) for m in self._models)
                ]
            )
            for begin in range(0, steps, BLOCK_STEPS):
                count = min(BLOCK_STEPS, steps - begin)
                rotation = fly_attitude_block(
                    self._sensors,
                    case,
                    rotation,
                    models,
                    runs,
                    self._surroundings.block(begin, count),
                    begin,
                    tallies,
                    c,
                    trace[c, :, begin : begin + count] if traced else trace[c],
                )
        return FlownAttitudes(tallies, trace)

    @staticmethod
    def _begun(p: AttitudeParameters, key: RandomKey, sigma_bn: Vec3, guess_deg: float) -> AttitudeParameters:
        """Parameters of a filter with its start in one case."""
        return p._replace(start=guessed_start(key, sigma_bn, guess_deg)) if guess_deg > 0.0 else p

    def _common_sensors(self) -> Sensors:
        array = self._array.values
        fields = [node for node in self.mission.nodes if node.component is Magnetometer]
        values = fields[0].values if fields else None
        return Sensors(
            period_ns=self.mission.period_ns,
            cells=sun_cells.parameters(array),
            albedo=array.albedo.enabled,
            gyro=gyro.parameters(self._gyro.values),
            magnetometer=magnetometer.Magnetometer(0.0, 0.0, 0.0, 0.0)
            if values is None
            else magnetometer.parameters(values),
            field_divider=0 if values is None else values.magnetometer.divider,
        )

    def _model(self, node: Node) -> FilterModel:
        """One filter with what its own models say at every step."""
        models, steps = FlightReferences(node.values), self.mission.steps
        table = np.zeros(steps, REFERENCE)
        light = aligned_table(steps if node.values.albedo.compensate else 1, len(models.light))
        for k in range(steps):
            r = models.at(k * self.mission.period_ns * 1e-9)
            table[k] = r.sun_n, r.field_n, r.intensity, r.sunlit
            if len(light) > 1:
                light[k] = models.light
        return FilterModel(attitude_options.parameters(node.values), table, light)

    def _case(self, number: int):
        plant, array = self._plant.values, self._array.values
        key = random_key(self.mission.values.mission.seed, number)
        nominal = cell_errors.nominal_cells(array.cells.normals, cell_screen.cell_sides(array))
        cells = nominal.copy()
        cell_errors.draw_cells(cell_errors.error_model(array), key, nominal, cells)
        craft = spacecraft(plant, key, plant.substeps)
        faults = cell_faults.case_faults(array, key)
        rotation = initial_conditions.initial_state(initial_conditions.parameters(plant), key)
        return Tumbler(key, craft, cells, faults, new_workspace()), rotation

    def _part(self, component: type[Component]) -> Node:
        nodes = [node for node in self.mission.nodes if node.component is component]
        if len(nodes) != 1:
            raise self._error(f"graph.nodes: {len(nodes)} of {component.__name__} given, expected one")
        return nodes[0]

    def _error(self, reason: str) -> MissionError:
        return MissionError(f"{self.mission.origin}: {reason}")


def fly_in_threads(
    flight: AttitudeFlight,
    cases: int,
    sample_every: int = 1,
    guess_deg: float = 0.0,
    progress: Callable[[int, int], None] | None = None,
) -> AttitudeTallies:
    """Tallies of cases 0 to `cases` - 1, flown side by side; arguments of `AttitudeFlight.fly`.

    Args:
        progress: told how many cases are done, and of how many.
    """
    chunks = [np.arange(first, min(first + _CHUNK_CASES, cases)) for first in range(0, cases, _CHUNK_CASES)]
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        futures = [pool.submit(flight.fly, numbers, sample_every, guess_deg) for numbers in chunks]
        done = 0
        for numbers, future in zip(chunks, futures, strict=True):
            future.result()
            done += len(numbers)
            if progress is not None:
                progress(done, cases)
    parts = [future.result().tallies for future in futures]
    return parts[0]._replace(
        totals=np.concatenate([part.totals for part in parts], axis=1),
        lit=np.concatenate([part.lit for part in parts], axis=1),
        samples=np.concatenate([part.samples for part in parts], axis=1),
    )
