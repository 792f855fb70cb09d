# SPDX-License-Identifier: Apache-2.0
"""Linearised propagation of every source of error through a mission's estimator, along flights without errors.

A flight with perfect sensors is the nominal. Along it the heading is a function of all readings, s_k(y_0, ..., y_k), of
which the estimator itself is the only description needed. Of an error source with covariance R that function's
derivative H gives the covariance H R H^T of the heading, whose trace is the mean square of the error:

    what lasts (scale, offset and tilt of each cell, bias, scale and alignment of the gyro): a column of H for each, by
        central differences of one standard deviation; the variances add up.
    what is white (noise, rounding): the trace of H R H^T by random signs z, E |H R^(1/2) z|^2 = tr H R H^T (Hutchinson
        1990), in pairs of z and -z, of which the difference is free of what is not linear.
    what is given (light of the Earth, response and losses of the cells): its own difference from the nominal.

Variances of different sources add up; how far that holds is what the Monte Carlo is for.
"""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from css_common.mission import Mission
from css_common.schema import Values
from css_design.budget.open_loop import Estimates, Path, cells_of_case, estimates, flown_path, readings
from css_design.budget.sources import (
    FILTER,
    LAYOUT,
    SOURCES,
    heard_sources,
    is_active,
    seeing_everywhere,
    without,
)
from css_design.budget.turning import Follower
from css_estimation.sun.sun_heading import Measured
from css_monte_carlo.mission_flight import MissionFlight
from css_monte_carlo.mission_parts import parts_of
from css_sim import gyro as gyro_model
from css_sim import magnetometer as magnetometer_model
from css_sim.cell_errors import error_model, tilted
from css_sim.sun_cells import parameters as cell_parameters

PROBES = 2
"""Pairs of random signs for each white source: 3 % of its mean square over an orbit of a filter that forgets in 3 s."""

_SEED = 20130601
_ROUNDED = 12.0  # variance of a rounding error: step^2 / 12

Tell = Callable[[int, int], None]


class Propagated(NamedTuple):
    """Mean squares over the counted steps of all nominal flights, by source [rad^2]."""

    heading: dict[str, float]
    pointing: dict[str, float] | None  # None: the loop of the control is not linear
    bound: float  # [rad] 95 % of the heading errors that all sources together make
    steps: int  # counted
    runs: int  # of the estimator


class Along:
    """A mission without errors along a path, and what differences from it come to."""

    def __init__(self, flight: MissionFlight, path: Path, follower: Follower | None = None) -> None:
        """Runs the estimator on perfect sensors.

        Args:
            flight: of the mission without errors.
            path: that it flew.
            follower: how its body follows; None: it is not said.
        """
        self.flight = flight
        self.path = path
        self.nominal = readings(flight, self.path)
        self.base = estimates(flight, self.path, self.nominal)
        self._follower = follower
        self.random = np.random.default_rng(_SEED + path.case)
        self.runs = 1

    def run(self, measured: Measured) -> np.ndarray:
        """Headings (M, 3) of other readings; those of the nominal where there is no estimate."""
        self.runs += 1
        return self.filled(estimates(self.flight, self.path, measured))

    def filled(self, found: Estimates) -> np.ndarray:
        """Headings of estimates, with those of the nominal where there is none."""
        return np.where((found.known & self.base.known)[:, None], found.sun_b, self.base.sun_b)

    def apart(self, plus: np.ndarray, minus: np.ndarray, share: float) -> np.ndarray:
        """(2, M) squares of the heading's and the pointing's difference [rad^2], at steps that do not count zero.

        Args:
            share: of the difference that is one standard deviation.
        """
        turn = share * np.cross(minus, plus)  # rotation vectors, small
        square = np.sum(turn**2, axis=1)
        followed = np.zeros(len(square))
        if self._follower is not None:
            followed = np.sum(self._follower.follow(turn, self.path.counted) ** 2, axis=1)
        return np.where(self.path.counted, np.stack([square, followed]), 0.0)

    def pair(self, change: Callable[[float], Measured]) -> np.ndarray:
        """Of readings that a parameter changes by plus and minus one standard deviation."""
        return self.apart(self.run(change(1.0)), self.run(change(-1.0)), 0.5)

    def single(self, measured: Measured) -> np.ndarray:
        """Of readings with an error that is given."""
        return self.apart(self.run(measured), self.base.sun_b, 1.0)


def propagate(mission: Mission, cases: int, tell: Tell) -> Propagated:
    """Propagates all sources along some flights.

    Args:
        mission: with everything switched on; scripted events are left out.
        cases: nominal flights, from case 0 on.
        tell: told how many flights are done, and of how many.
    """
    ideal = without(mission, heard_sources(mission))
    flight = MissionFlight(ideal)
    follower = Follower.of(ideal)
    squares: dict[str, list[np.ndarray]] = {}
    counted, runs = 0, 0
    for case in range(cases):
        tell(case, cases)
        around = flight.around_case(case) if flight.own_surroundings else flight
        along = Along(around, flown_path(around, case)[0], follower)
        mask = along.path.counted & along.base.known
        for name, square in squares_by_source(mission, along):
            squares.setdefault(name, []).append(square[:, mask])
        counted += int(np.count_nonzero(mask))
        runs += along.runs
    tell(cases, cases)
    together = {name: np.concatenate(parts, axis=1) for name, parts in squares.items()}
    means = {name: square.mean(axis=1) if counted else np.full(2, np.nan) for name, square in together.items()}
    total = sum((square[0] for square in together.values()), np.zeros(counted))
    return Propagated(
        {name: float(mean[0]) for name, mean in means.items()},
        None if follower is None else {name: float(mean[1]) for name, mean in means.items()},
        rayleigh_percentile(total, 0.95),
        counted,
        runs,
    )


def rayleigh_percentile(squares: np.ndarray, share: float) -> float:
    """Angle [rad] below which a share of errors lies, by their mean squares at each step [rad^2], alike on two axes."""
    if not len(squares) or not np.any(squares > 0.0):
        return float("nan") if not len(squares) else 0.0
    low, high = 0.0, 10.0 * float(np.sqrt(np.max(squares)))
    for _ in range(60):
        middle = 0.5 * (low + high)
        with np.errstate(divide="ignore"):
            below = float(np.mean(-np.expm1(-(middle**2) / squares)))
        low, high = (middle, high) if below < share else (low, middle)
    return high


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
