# SPDX-License-Identifier: Apache-2.0
"""The error budget of a mission: predicted by propagation, measured by the Monte Carlo, side by side."""

import math
from typing import Any, NamedTuple

import numpy as np

from css_common.mission import Mission
from css_design.budget import measured, propagation
from css_design.budget.measured import ALL, Errors, Estimate, Split
from css_design.budget.propagation import Propagated
from css_design.budget.sources import FILTER, LAYOUT, SOURCES, heard_sources, is_active, refuse_calibrated
from css_design.errors import DesignError
from css_monte_carlo.mission_parts import is_heading, parts_of
from css_sim.earth_reflectivity import clouds_move

_ALIKE = 1.33  # ratio within which two are taken for the same
_MATTERS = 0.02  # of the mean square: what is less is not worth a remark
_DEG = 180.0 / math.pi


class Row(NamedTuple):
    """A source in the budget of one error; angles in deg, NaN for what is not known."""

    source: str
    predicted: float
    alone: Estimate
    left_out: Estimate
    remark: str

    @property
    def ratio(self) -> float:
        """Predicted over measured alone."""
        return self.predicted / self.alone.value if self.alone.value > 0.0 else math.nan


class Part(NamedTuple):
    """The budget of one error; angles in deg."""

    name: str  # heading or pointing
    rows: list[Row]
    predicted_sum: float  # root of the sum of the predicted squares
    alone_sum: Estimate  # the same of those measured alone: without an interval
    total: Estimate  # root mean square with all sources, measured
    bound: Estimate  # 95 % of the errors, measured
    predicted_bound: float


class Budget(NamedTuple):
    """The budget of a mission."""

    mission: str
    estimator: str
    cases: int
    acquired: int  # cases that found the Sun for good
    parts: list[Part]
    remarks: list[str]


def budget_of(
    mission: Mission, cases: int, nominal: int, tell_flown: measured.Tell, tell_predicted: propagation.Tell
) -> Budget:
    """Flies and propagates.

    Args:
        cases: of each configuration of the Monte Carlo.
        nominal: flights along which errors are propagated.
        tell_flown, tell_predicted: told how much is done, and of how much.

    Raises:
        DesignError: the mission estimates no Sun.
        MissionError: the compiled loop has no place for something of the mission.
    """
    _check(mission)
    flown = measured.fly(measured.configurations(mission), cases, tell_flown)
    predicted = propagation.propagate(mission, nominal, tell_predicted)
    active = [source for source in heard_sources(mission) if is_active(mission, source)]
    parts = [
        _part("heading", predicted.heading, predicted, flown, measured.split(flown, active, "heading")),
        _part("pointing", predicted.pointing, predicted, flown, measured.split(flown, active, "pointing")),
    ]
    return Budget(
        mission.name,
        mission.values.graph.estimator,
        cases,
        int(np.count_nonzero(np.isfinite(flown[ALL].pointing))),
        parts,
        list(_remarks(mission, predicted, flown)),
    )


def _check(mission: Mission) -> None:
    refuse_calibrated(mission)
    name = mission.values.graph.estimator
    node = next((node for node in mission.nodes if node.name == name), None)
    if node is None or not is_heading(node):
        what = "is not in the graph" if node is None else "estimates no Sun"
        raise DesignError(
            f"{mission.origin}: graph.estimator: {name} {what}, expected a Sun estimator, whose heading is split"
        )


def _part(
    name: str,
    predicted: dict[str, float] | None,
    whole_of: Propagated,
    flown: dict[str, Errors],
    split: dict[str, Split],
) -> Part:
    squares = predicted or {}
    whole = flown[ALL]
    total = measured.root_mean_square(getattr(whole, name))
    samples = whole.samples if name == "heading" else whole.pointing_samples
    order = [source.name for source in SOURCES if source.name in split]
    order += [source for source in (LAYOUT, FILTER) if source in split]
    seconds = whole_of.second_order if name == "heading" else {}
    rows = [
        _row(source, squares.get(source, math.nan), seconds.get(source, 0.0), split[source], total.value)
        for source in order
    ]
    alone = [row.alone.value for row in rows if math.isfinite(row.alone.value)]
    summed = math.sqrt(max(0.0, sum(math.copysign(value**2, value) for value in alone)))
    return Part(
        name,
        rows,
        _DEG * math.sqrt(sum(squares.values())) if squares else math.nan,
        Estimate(summed, math.nan, math.nan),
        _degrees(total),
        _degrees(measured.bound(samples)),
        _DEG * whole_of.bound if name == "heading" else math.nan,
    )


def _degrees(estimate: Estimate) -> Estimate:
    return Estimate(*(_DEG * value for value in estimate))


def _row(source: str, square: float, second: float, split: Split, total: float) -> Row:
    predicted = math.sqrt(square) if square >= 0.0 else math.nan
    remark = remark_on(predicted, split, total, math.sqrt(second) if second >= 0.0 else 0.0)
    return Row(source, _DEG * predicted, _degrees(split.alone), _degrees(split.left_out), remark)


def remark_on(predicted: float, split: Split, total: float, second_order: float = 0.0) -> str:
    """Words where propagation and Monte Carlo disagree, or the Monte Carlo with itself; empty where they agree.

    Args:
        predicted: root mean square by propagation.
        split: by the Monte Carlo.
        total: that of all sources together.
        second_order: what propagation leaves out because it is not linear.
    """
    alone, left_out = split
    least = math.sqrt(_MATTERS) * total
    words = []
    if math.isfinite(predicted) and max(predicted, alone.value) > least and not _agree(predicted, alone):
        if predicted > max(alone.high, 0.0):
            words.append("linear propagation says more than flights show")
        else:
            words.append("flights show more than linear propagation says: not linear, or it moves the flight itself")
            if second_order > 0.5 * predicted:
                words.append(f"of second order it makes {_DEG * second_order:.2f} deg")
    if math.isfinite(left_out.value) and max(abs(left_out.value), abs(alone.value)) > least:
        if left_out.value < 0.0 and left_out.high < 0.0:
            words.append("beside the others errors are smaller with it")
        elif left_out.low > _ALIKE * max(alone.high, 0.0):
            words.append("costs more beside the others than alone")
        elif alone.low > _ALIKE * max(left_out.high, 0.0):
            words.append("hidden by the others")
    return "; ".join(words)


def _agree(predicted: float, alone: Estimate) -> bool:
    if alone.low <= predicted <= alone.high:
        return True
    return alone.value > 0.0 and 1.0 / _ALIKE <= predicted / alone.value <= _ALIKE


def _remarks(mission: Mission, predicted: Propagated, flown: dict[str, Errors]) -> Any:
    lost = int(np.count_nonzero(~np.isfinite(flown[ALL].pointing)))
    if lost:
        yield f"{lost} cases never had the Sun within 30 deg for 60 s and are left out"
    if not predicted.steps:
        yield "no nominal flight acquired the Sun: nothing is predicted"
    if predicted.pointing is None:
        yield "pointing is not predicted: its control is no linear loop (a deadband, a spin or none)"
    if mission.events:
        yield "scripted events fly in the Monte Carlo; the propagation goes by the parameters of the start"
    if mission.faults:
        yield "faults of the mission act in every configuration"
    array = parts_of(mission).array.values
    if array.albedo.enabled and clouds_move(array):
        yield "clouds move in the flights; the propagation lets them stand as they are at the start"
    for node in mission.nodes:
        if getattr(node.values, "latency", 0.0) or getattr(node.values, "latency_spread", 0.0):
            yield f"latency of {node.name} counts as {FILTER}"
