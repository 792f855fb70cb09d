# SPDX-License-Identifier: Apache-2.0
"""A few cases of one configuration flown from start to end: the unit of work, of resuming and of distribution."""

import time
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from css_analysis.errors import StudyError
from css_analysis.flight_metrics import windows_of
from css_common.mission import mission_from_text
from css_monte_carlo.case_missions import drawn_columns
from css_monte_carlo.case_table import case_table
from css_monte_carlo.case_tallies import Tallies
from css_monte_carlo.drawn_faults import COLUMN, fault_column, has_faults
from css_monte_carlo.flight_threads import FlightThreads, go_on_if_waited_for
from css_monte_carlo.health_tallies import HealthTallies
from css_monte_carlo.loop import Cases, Vehicle, fly_block
from css_monte_carlo.measures import CaseTallies
from css_monte_carlo.mission_flight import MissionFlight
from css_monte_carlo.mission_parts import NoPlace
from css_monte_carlo.state_table import StateTable
from css_monte_carlo.stepped_flight import SteppedFlight
from css_monte_carlo.surroundings import BLOCK_STEPS
from css_sim.flight_checks import MotionError, check_rate

_SHARE = 10  # cases that a thread flies at a time


class ChunkTask(NamedTuple):
    """Everything that a worker needs to know, wherever it runs."""

    mission_text: str
    origin: str
    first_case: int
    cases: int
    sample_every: int  # steps from sample to sample
    estimator: str | None = None  # node whose estimates are measured; None: `graph.estimator`
    guess_deg: float = 0.0  # of `MissionFlight.cases`


class Flown(NamedTuple):
    """What the cases of a chunk gave."""

    tallies: CaseTallies  # running sums of the measured estimator
    trace: np.ndarray  # (C, steps, `MissionFlight.trace_columns`) of every step's values; empty unless asked for
    cpu_s: float  # processor time of the loop, without preparation


def flown_task(task: ChunkTask) -> tuple[pa.Table, float]:
    """Table of a task's cases, which depends on nothing but the task, and processor time [s] of its loop."""
    flight = _flight_of(task.mission_text, task.origin, task.estimator)
    numbers = np.arange(task.first_case, task.first_case + task.cases)
    if isinstance(flight, SteppedFlight):
        tallies, cpu_s = flight.fly(numbers, task.sample_every, task.guess_deg)
    else:
        tallies, _, cpu_s = fly_cases(flight, numbers, task.sample_every, task.guess_deg)
    period_s = flight.mission.period_ns * 1e-9
    table = case_table(numbers, tallies, period_s, windows_of(flight.mission))
    if has_faults(flight.mission):
        table = table.append_column(COLUMN, fault_column(flight.mission, numbers))
    for name, values in drawn_columns(flight.mission, numbers).items():
        table = table.append_column(name, values)
    return table, cpu_s


@lru_cache(maxsize=2)
def _flight_of(mission_text: str, origin: str, estimator: str | None) -> MissionFlight | SteppedFlight:
    # Tables of the environment, 1 kB a step, are worth keeping from chunk to chunk. Chunks come sorted by mission, so
    # that threads work on one or two.
    mission = mission_from_text(mission_text, origin)
    try:
        return MissionFlight(mission, estimator)
    except NoPlace:
        return SteppedFlight(mission, estimator)


def fly_cases(
    flight: MissionFlight, numbers: np.ndarray, sample_every: int, guess_deg: float = 0.0, traced: bool = False
) -> Flown:
    """Flies cases (C,) of a mission, each independent of the others; `guess_deg` as of `MissionFlight.cases`."""
    if not flight.own_surroundings:
        return _fly_together(flight, numbers, sample_every, guess_deg, traced)
    parts = []
    for number in numbers:
        alone = flight.around_case(int(number))
        own = np.array([alone.mission.values.mission.case])
        parts.append(_fly_together(alone, own, sample_every, guess_deg, traced))
    trace = np.concatenate([part.trace for part in parts])
    return Flown(_joined([part.tallies for part in parts]), trace, sum(part.cpu_s for part in parts))


def _fly_together(
    flight: MissionFlight, numbers: np.ndarray, sample_every: int, guess_deg: float, traced: bool
) -> Flown:
    """Flies cases that share their surroundings."""
    cases, initial = flight.cases(numbers, guess_deg)
    period_s = flight.mission.period_ns * 1e-9
    tallies = flight.measure.new_tallies(len(numbers), flight.steps, period_s, sample_every, windows_of(flight.mission))
    trace = np.zeros((len(numbers), flight.steps, flight.trace_columns) if traced else (0, 0, 0))
    states = StateTable(initial)
    cpu_s = 0.0
    first, nothing = next(flight.stretches(cases)), flight.surroundings.block(0, 1)
    # no steps: compiled, or loaded, before time is taken
    fly_block(first.vehicle, cases, states.rows, states.like, nothing, flight.marks[:0], 0, tallies, trace)
    for vehicle, tables, begin, end in _blocks(flight, cases):
        go_on_if_waited_for()
        around, marks = flight.surroundings.block(begin, end - begin), flight.marks[begin:end]
        start = time.thread_time()
        fly_block(vehicle, tables, states.rows, states.like, around, marks, begin, tallies, trace)
        cpu_s += time.thread_time() - start
        _check_motion(flight, numbers, cases.rates, begin)
    return Flown(tallies, trace, cpu_s)


def _blocks(flight: MissionFlight, cases: Cases) -> Iterator[tuple[Vehicle, Cases, int, int]]:
    """Each block of steps, from the first to before the last, and what flies in it."""
    for stretch in flight.stretches(cases):
        for begin in range(stretch.first, stretch.end, BLOCK_STEPS):
            yield stretch.vehicle, stretch.cases, begin, min(begin + BLOCK_STEPS, stretch.end)


def fly_in_threads(
    flights: Sequence[MissionFlight],
    cases: int,
    *,
    guess_deg: float = 0.0,
    progress: Callable[[int, int], None] | None = None,
) -> list[Any]:
    """Tallies of cases 0 to `cases` - 1 of each flight, flown side by side, with a sample at every step.

    Args:
        guess_deg: as of `MissionFlight.cases`.
        progress: told how many cases are done, and of how many.
    """
    numbers = [np.arange(first, min(first + _SHARE, cases)) for first in range(0, cases, _SHARE)]
    with FlightThreads() as pool:
        futures = [[pool.submit(fly_cases, flight, part, 1, guess_deg) for part in numbers] for flight in flights]
        done, total = 0, cases * len(flights)
        for of_flight in futures:
            for part, future in zip(numbers, of_flight, strict=True):
                future.result()
                done += len(part)
                if progress is not None:
                    progress(done, total)
    return [_joined([future.result().tallies for future in of_flight]) for of_flight in futures]


def _joined(parts: Sequence[Any]) -> Any:
    """Tallies of all cases of some, in their order."""
    first = parts[0]
    joined: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in ("totals", "histogram", "samples")
    }
    if isinstance(first, Tallies):
        joined["health"] = HealthTallies(*map(np.concatenate, zip(*(part.health for part in parts), strict=True)))
    return first._replace(**joined)


def _check_motion(flight: MissionFlight, numbers: np.ndarray, rates: np.ndarray, step: int) -> None:
    for number, rate in zip(numbers, rates, strict=True):
        try:
            check_rate(rate)
        except MotionError as error:
            after = step * flight.mission.period_ns * 1e-9
            raise StudyError(f"case {number} of {flight.mission.name}, after {after:g} s: {error}") from error
