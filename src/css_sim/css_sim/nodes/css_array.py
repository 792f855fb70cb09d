# SPDX-License-Identifier: Apache-2.0
"""Simulated coarse sun sensors."""

from collections.abc import Iterable, Mapping

import numpy as np

from css_common.attitude import mrp_to_dcm
from css_common.case_faults import CaseFault
from css_common.component import INERTIAL, Component, Finding, Input, Outgoing, Output, Received
from css_common.fault_lines import Units
from css_common.kernel import typed_call
from css_common.mission_node import Node
from css_common.mission_section import CASE, SEED
from css_common.random_streams import random_key
from css_common.run import node_main
from css_common.schema import Values
from css_common.vectors import Mat3, multiply, vector_of
from css_environment.albedo import new_workspace
from css_environment.albedo_vector import MODELS, earth_light_sources
from css_environment.earth_light import new_earth_view, new_light
from css_environment.earth_rotation import advance_dcm_en, dcm_en_at
from css_environment.ephemeris import segment_start
from css_environment.moving_clouds import CLOUD_STEP_NS, reflect
from css_msgs.msg import CssVoltages, SpacecraftState
from css_sensors.cells import LARGEST_READING, NORMALS, SMALLEST_READING
from css_sim import (
    cell_errors,
    cell_faults,
    cell_response,
    cell_screen,
    earth_reflectivity,
    failing,
    latency,
    sun_cells,
)
from css_sim.delayed import Delayed
from css_sim.failing import Failing, fault_outputs
from css_sim.sensing import CellsOfCase, sense_cells
from css_sim.sensor_checks import LOUDEST_CELL, noise_findings
from css_sim.sun_cells import NOISE, OUTPUT_HIGH, OUTPUT_LOW


class CssArray(Component):
    """Outputs of the coarse sun sensor cells in the light of the Sun and of the Earth (O'Keefe & Schaub 2013)."""

    shared = ("cells",)
    fault_kinds = cell_faults.KINDS
    _failing = Failing(())  # of a node that has not begun
    parameters = (
        *sun_cells.PARAMETERS,
        *cell_faults.PARAMETERS,
        failing.REPORT,
        *cell_errors.PARAMETERS,
        *cell_screen.PARAMETERS,
        *earth_reflectivity.PARAMETERS,
        *latency.PARAMETERS,
    )

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        used = ("r_n", "sigma_bn", "sun_n", "solar_flux", "illumination")
        return (Input("truth", "truth", SpacecraftState, frame=INERTIAL, used=used),)

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        drawn = cell_faults.parameters(values).random.cells > 0
        return (Output("voltages", "css/voltages", CssVoltages), *fault_outputs(name, values, drawn))

    @classmethod
    def fault_units(cls, values: Values) -> Units:
        return cell_faults.units(values)

    @classmethod
    def needed(cls, values: Values) -> tuple[str, ...]:
        return ("cells.normals",)

    @classmethod
    def conflicts(cls, values: Values) -> Iterable[str]:
        yield from cell_faults.conflicts(values)
        yield from cell_screen.conflicts(values)
        yield from cell_response.conflicts(values)
        yield from earth_reflectivity.conflicts(values)
        yield from latency.conflicts(values)
        if len(values[cell_response.ANGLES]) and sun_cells.parameters(values).warp:
            yield "warp: true given together with response.angles_deg, expected false: the table is the whole response"
        if values[OUTPUT_LOW] >= values[OUTPUT_HIGH]:
            yield f"output_low: {values[OUTPUT_LOW]:g} given, expected less than output_high"
        # estimators would take for missing what these cells put out
        if values[OUTPUT_LOW] < values[SMALLEST_READING]:
            yield f"output_low: {values[OUTPUT_LOW]:g} given, expected at least cells.smallest_reading"
        if values[OUTPUT_HIGH] > values[LARGEST_READING]:
            yield f"output_high: {values[OUTPUT_HIGH]:g} given, expected at most cells.largest_reading"

    @classmethod
    def preflight(cls, node: Node, graph: Mapping[str, Node]) -> Iterable[Finding]:
        return noise_findings(NOISE, node.values, LOUDEST_CELL)

    @property
    def albedo(self) -> np.ndarray:
        """Light of the Earth (N,) on the cells in the last cycle [-]."""
        return self._cells.albedo

    def configure(self) -> None:
        values = self.values
        self._key = random_key(values[SEED], values[CASE])
        self._p = sun_cells.parameters(values)
        nominal = cell_errors.nominal_cells(values[NORMALS], cell_screen.cell_sides(values))
        cells = nominal.copy()
        cell_errors.draw_cells(cell_errors.error_model(values), self._key, nominal, cells)
        self._faults = cell_faults.of_case(values, self._key)
        self._failing = Failing(self._case_faults(), self._failing)
        self._cells = CellsOfCase(cells, self._failing.table, np.zeros(len(cells)), new_workspace())
        grid = earth_reflectivity.source(values, self.epoch_ns)
        self._reflectivity = earth_reflectivity.case_reflectivity(values, grid, self._key)
        light = earth_reflectivity.parameters(values)
        self._earthlit, self._albedo_model = light.enabled, MODELS[light.model]
        self._clouds = earth_reflectivity.clouds(values, grid if light.enabled else None)
        self._cloud_step = -1
        if self._clouds.moving:
            self._cloud_motion, self._cloud_fields = earth_reflectivity.case_clouds(values, grid, self._key)
        self._reflect = typed_call(reflect)
        self._delayed = Delayed(latency.parameters(values), self._key, latency.CELLS)
        self._view, self._light = new_earth_view(), new_light()
        self._segment_s = -1.0
        self._to_dcm, self._turn = typed_call(mrp_to_dcm), typed_call(multiply)
        self._advance_earth = typed_call(advance_dcm_en)
        self._sources, self._sense = typed_call(earth_light_sources), typed_call(sense_cells)
        self._dcm_en = dcm_en_at(self.epoch_ns, 0.0)

    def tune(self, values: Values) -> None:
        super().tune(values)
        self._p = sun_cells.parameters(values)
        self._failing.take(self._case_faults())
        self._cells = self._cells._replace(faults=self._failing.table)

    def _case_faults(self) -> list[CaseFault]:
        return cell_faults.case_faults(self.values, self._key, self._faults)

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        truth = received["truth"]
        sigma_bn, sun_n = vector_of(truth.sigma_bn), vector_of(truth.sun_n)
        intensity = truth.solar_flux * truth.illumination
        step = self.step_of(stamp_ns)
        of_sun = self._delayed(step, sigma_bn=sigma_bn, sun_n=sun_n, intensity=intensity)
        dcm_bn = self._to_dcm(of_sun.sigma_bn)
        if self._earthlit:
            dcm_en = self._earth_attitude((stamp_ns - self.epoch_ns) * 1e-9)
            if self._clouds.moving:
                self._move_clouds(stamp_ns - self.epoch_ns)
            self._sources(
                self._albedo_model,
                self._view,
                vector_of(truth.r_n),
                sun_n,
                truth.solar_flux,
                dcm_en,
                self._reflectivity,
                self._light,
            )
        voltages = np.zeros(len(self._cells.cells))
        saturated = self._sense(
            self._p,
            self._cells,
            self._key,
            step,
            dcm_bn,
            self._turn(dcm_bn, of_sun.sun_n),
            of_sun.intensity,
            self._earthlit,
            self._light,
            voltages,
        )
        outputs = self.message("voltages", stamp_ns, saturated=saturated, voltages=voltages)
        return {"voltages": outputs, **self._failing.told(self, stamp_ns)}

    def _move_clouds(self, elapsed_ns: int) -> None:
        if elapsed_ns // CLOUD_STEP_NS != self._cloud_step:
            self._cloud_step = elapsed_ns // CLOUD_STEP_NS
            self._reflect(self._clouds, self._cloud_motion, self._cloud_fields, elapsed_ns, self._reflectivity)

    def _earth_attitude(self, elapsed_s: float) -> Mat3:
        """Rotation from n to the Earth-fixed frame, in the same segments and so the same digits as the ephemeris."""
        start_s = segment_start(elapsed_s)
        if start_s != self._segment_s:
            self._segment_s = start_s
            self._dcm_en = dcm_en_at(self.epoch_ns, start_s)
        return self._advance_earth(self._dcm_en, elapsed_s - start_s)


main = node_main(CssArray)
