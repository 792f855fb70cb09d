# SPDX-License-Identifier: Apache-2.0
"""What each source of error does to the readings, and so to heading and pointing: see `propagation`."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from css_common.mission import Mission
from css_common.schema import Values
from css_design.budget.along import Along
from css_design.budget.open_loop import Path, cells_of_case, estimates, readings
from css_design.budget.sources import FILTER, LAYOUT, SOURCES, heard_sources, is_active, seeing_everywhere, without
from css_estimation.sun.sun_heading import Measured
from css_monte_carlo.mission_flight import MissionFlight
from css_monte_carlo.mission_parts import parts_of
from css_sim import gyro as gyro_model
from css_sim import magnetometer as magnetometer_model
from css_sim.cell_errors import error_model, tilted
from css_sim.sun_cells import parameters as cell_parameters

PROBES = 2
"""Pairs of random signs for each white source: 3 % of its mean square over an orbit of a filter that forgets in 3 s."""

_ROUNDED = 12.0  # variance of a rounding error: step^2 / 12


def squares_by_source(mission: Mission, along: Along) -> Iterator[tuple[str, np.ndarray]]:
    """(2, M) mean squares [rad^2] of heading and pointing at each step, of each source that a mission has."""
    kinds = {
        "noise": _noise,
        "albedo": _given,
        "calibration": _calibration,
        "misalignment": _misalignment,
        "quantisation": _quantisation,
        "gyro": _gyro,
        "magnetometer": _magnetometer,
    }
    for source in heard_sources(mission):
        if is_active(mission, source):
            node = mission.node(_name_of(mission, source.part))
            yield source.name, kinds[source.name](mission, along, node.values)
    yield from _perfect(along)


def _name_of(mission: Mission, part: str) -> str:
    return str(getattr(parts_of(mission), part).name)


def _perfect(along: Along) -> Iterator[tuple[str, np.ndarray]]:
    """Layout and filter: what is left with perfect sensors."""
    dense = seeing_everywhere(along.flight.mission)
    truth = along.path.sun_b
    if dense is None:
        yield FILTER, along.apart(along.base.sun_b, truth, 1.0)
        return
    flight = MissionFlight(dense)
    flight = flight.around_case(along.path.case) if flight.own_surroundings else flight
    along.runs += 1
    best = along.filled(estimates(flight, along.path, readings(flight, along.path)))
    yield LAYOUT, along.apart(along.base.sun_b, best, 1.0)
    yield FILTER, along.apart(best, truth, 1.0)


def _with_cells(along: Along, voltages: np.ndarray, values: Values) -> Measured:
    """The nominal readings with other outputs of the cells, within the limits of their converter."""
    p = cell_parameters(values)
    return along.nominal._replace(voltages=np.clip(voltages, p.output_low, p.output_high))


def _white(along: Along, shape: tuple[int, ...], change: Callable[[np.ndarray], Measured]) -> np.ndarray:
    """Mean over the probes of what is white, of which `change` is given one standard deviation."""
    total = np.zeros((2, len(along.path.truth)))
    for _ in range(PROBES):
        signs = along.random.choice((-1.0, 1.0), shape)
        total += along.pair(lambda side, signs=signs: change(side * signs))  # type: ignore[misc]
    return total / PROBES


def _noise(mission: Mission, along: Along, values: Values) -> np.ndarray:
    outputs, sigma = along.nominal.voltages, cell_parameters(values).noise
    return _white(along, outputs.shape, lambda signs: _with_cells(along, outputs + sigma * signs, values))


def _quantisation(mission: Mission, along: Along, values: Values) -> np.ndarray:
    """Rounding down: half a step of offset, and white errors of a step's width; then the threshold."""
    outputs, p = along.nominal.voltages, cell_parameters(values)
    total = np.zeros((2, len(outputs)))
    if p.levels > 0.0:
        step = (p.output_high - p.output_low) / p.levels
        sigma = step / np.sqrt(_ROUNDED)
        total += _white(along, outputs.shape, lambda signs: _with_cells(along, outputs + sigma * signs, values))
        total += along.single(_with_cells(along, outputs - 0.5 * step, values))
    if p.dropout > 0.0:
        total += along.single(_with_cells(along, np.where(outputs < p.dropout, 0.0, outputs), values))
    return total


def _given(mission: Mission, along: Along, values: Values) -> np.ndarray:
    """The light of the Earth of the flight's own case."""
    others = [source for source in SOURCES if source.name != "albedo" and source in heard_sources(mission)]
    return along.single(_readings_of(without(mission, others), along.path))


def _readings_of(mission: Mission, path: Path) -> Measured:
    flight = MissionFlight(mission)
    flight = flight.around_case(path.case) if flight.own_surroundings else flight
    return readings(flight, path)


def _calibration(mission: Mission, along: Along, values: Values) -> np.ndarray:
    model, outputs = error_model(values), along.nominal.voltages
    scale = float(np.hypot(model.scale_cell_error, model.fixed_degradation / np.sqrt(_ROUNDED)))
    total = np.zeros((2, len(outputs)))

    def of_cell(cell: int, gain: float, offset: float) -> Callable[[float], Measured]:
        def change(side: float) -> Measured:
            changed = outputs.copy()
            changed[:, cell] = changed[:, cell] * (1.0 + side * gain) + side * offset
            return _with_cells(along, changed, values)

        return change

    for cell in range(outputs.shape[1]):
        if scale > 0.0:
            total += along.pair(of_cell(cell, scale, 0.0))
        if model.bias > 0.0:
            total += along.pair(of_cell(cell, 0.0, model.bias))
    if model.scale_common_error > 0.0:
        sigma = model.scale_common_error
        total += along.pair(lambda side: _with_cells(along, outputs * (1.0 + side * sigma), values))
    return total + _response(mission, along, values)


def _response(mission: Mission, along: Along, values: Values) -> np.ndarray:
    """Response curve, losses and scale that all cells have, as they are drawn for the case."""
    lasting = ("scale_common_error", "scale_cell_error", "bias", "fixed_degradation")
    array = _name_of(mission, "array")
    ideal = without(mission, [source for source in heard_sources(mission) if source.name != "calibration"])
    given = ideal.with_overrides([f"{array}.{key}=0.0" for key in lasting])
    calibration = next(source for source in SOURCES if source.name == "calibration")
    if not is_active(given, calibration):
        return np.zeros((2, len(along.path.truth)))
    return along.single(_readings_of(given, along.path))


def _misalignment(mission: Mission, along: Along, values: Values) -> np.ndarray:
    sigma, nominal = error_model(values).misalignment, along.nominal.voltages
    cells = cells_of_case(along.flight, along.path.case)
    total = np.zeros((2, len(nominal)))
    for about in ((sigma, 0.0), (0.0, sigma)):
        sides: dict[float, np.ndarray] = {}
        for side in (1.0, -1.0):
            moved = cells.copy()
            for cell in moved:
                cell["nx"], cell["ny"], cell["nz"] = tilted(
                    (float(cell["nx"]), float(cell["ny"]), float(cell["nz"])), side * about[0], side * about[1]
                )
            sides[side] = readings(along.flight, along.path, moved).voltages
        for cell in range(nominal.shape[1]):

            def change(side: float, cell: int = cell, sides: dict[float, np.ndarray] = sides) -> Measured:
                changed = nominal.copy()
                changed[:, cell] = sides[side][:, cell]
                return along.nominal._replace(voltages=changed)

            total += along.pair(change)
    return total


def _gyro(mission: Mission, along: Along, values: Values) -> np.ndarray:
    p, rates = gyro_model.parameters(values), along.nominal.gyro_b
    count = len(rates)
    total = np.zeros((2, count))
    white = float(np.hypot(p.noise, p.resolution / np.sqrt(_ROUNDED)))
    if white > 0.0:
        total += _white(along, rates.shape, lambda signs: along.nominal._replace(gyro_b=rates + white * signs))
    # a walk counts as the bias that has its mean variance over the flight
    bias = float(np.hypot(p.bias, p.bias_walk * np.sqrt(0.5 * count)))
    responses = [(i, i, p.scale_error) for i in range(3)]
    responses += [(i, j, p.misalignment) for i in range(3) for j in range(3) if i != j]
    for axis in range(3):
        if bias > 0.0:
            total += along.pair(_shifted(along.nominal, "gyro_b", axis, bias))
    for i, j, sigma in responses:
        if sigma > 0.0:
            total += along.pair(_coupled(along.nominal, i, j, sigma))
    return total


def _magnetometer(mission: Mission, along: Along, values: Values) -> np.ndarray:
    p, field = magnetometer_model.parameters(values), along.nominal.field_b
    total = np.zeros((2, len(field)))
    if not np.any(along.nominal.field_valid):
        return total  # the estimator does not listen
    white = float(np.hypot(p.noise, p.resolution / np.sqrt(_ROUNDED)))
    if white > 0.0:
        total += _white(along, field.shape, lambda signs: along.nominal._replace(field_b=field + white * signs))
    for axis in range(3):
        if p.bias > 0.0:
            total += along.pair(_shifted(along.nominal, "field_b", axis, p.bias))
    return total


def _shifted(nominal: Measured, key: str, axis: int, sigma: float) -> Callable[[float], Measured]:
    def change(side: float) -> Measured:
        changed = getattr(nominal, key).copy()
        changed[:, axis] += side * sigma
        return _replaced(nominal, key, changed)

    return change


def _coupled(nominal: Measured, i: int, j: int, sigma: float) -> Callable[[float], Measured]:
    def change(side: float) -> Measured:
        changed = nominal.gyro_b.copy()
        changed[:, i] += side * sigma * nominal.gyro_b[:, j]
        return nominal._replace(gyro_b=changed)

    return change


def _replaced(nominal: Measured, key: str, value: Any) -> Measured:
    return nominal._replace(**{key: value})
