# SPDX-License-Identifier: Apache-2.0
"""A few cases of one configuration flown from start to end: the unit of work, of resuming and of distribution."""

import time
from collections.abc import Iterable
from functools import lru_cache
from typing import NamedTuple

import numba.typed
import numpy as np

from css_common.mission import Mission, mission_from_text
from css_monte_carlo.case_tallies import Tallies, new_tallies
from css_monte_carlo.loop import fly_block, trace_columns
from css_monte_carlo.mission_flight import MissionFlight
from css_monte_carlo.study_folder import StudyError
from css_monte_carlo.surroundings import BLOCK_STEPS
from css_sim.flight_checks import MotionError, check_rate


class ChunkTask(NamedTuple):
    """Everything that a worker needs to know, wherever it runs."""

    mission_text: str
    origin: str
    first_case: int
    cases: int
    sample_every: int  # steps from sample to sample


class Flown(NamedTuple):
    """What the cases of a chunk gave."""

    tallies: Tallies
    trace: np.ndarray  # (C, steps, columns) of every step's values, see `loop.TRACE`; empty unless asked for
    cpu_s: float  # processor time of the loop, without preparation


def flown_task(task: ChunkTask) -> tuple[np.ndarray, Mission, Flown]:
    """Case numbers, mission and flights of a task, in any process: they depend on nothing but the task."""
    flight = _flight_of(task.mission_text, task.origin)
    numbers = np.arange(task.first_case, task.first_case + task.cases)
    return numbers, flight.mission, fly_cases(flight, numbers, task.sample_every)


@lru_cache(maxsize=2)
def _flight_of(mission_text: str, origin: str) -> MissionFlight:
    # Tables of the environment, 1 kB a step, are worth keeping from chunk to chunk. Chunks come sorted by mission, so
    # that threads work on one or two.
    return MissionFlight(mission_from_text(mission_text, origin))


def fly_cases(flight: MissionFlight, numbers: np.ndarray, sample_every: int, traced: bool = False) -> Flown:
    """Flies cases (C,) of a mission, each independent of the others."""
    cases, initial = flight.cases(numbers)
    tallies = new_tallies(len(numbers), flight.steps, flight.mission.period_ns * 1e-9, sample_every)
    columns = trace_columns(cases.wheel_momentum.shape[1])
    trace = np.zeros((len(numbers), flight.steps, columns) if traced else (0, 0, 0))
    states = numba.typed.List(initial)
    cpu_s = 0.0
    first = next(flight.stretches(cases))
    # no steps: compiled, or loaded, before time is taken
    fly_block(first.vehicle, cases, states, flight.surroundings.block(0, 1), flight.marks[:0], 0, tallies, trace)
    for stretch in flight.stretches(cases):
        for begin in range(stretch.first, stretch.end, BLOCK_STEPS):
            rows = slice(begin, min(begin + BLOCK_STEPS, stretch.end))
            around = flight.surroundings.block(begin, rows.stop - begin)
            block_trace = trace[:, rows] if traced else trace
            start = time.thread_time()
            fly_block(stretch.vehicle, stretch.cases, states, around, flight.marks[rows], begin, tallies, block_trace)
            cpu_s += time.thread_time() - start
            _check_motion(flight, numbers, states, begin)
    return Flown(tallies, trace, cpu_s)


def _check_motion(flight: MissionFlight, numbers: np.ndarray, states: Iterable, step: int) -> None:
    for number, state in zip(numbers, states, strict=True):
        try:
            check_rate(state.rotation.omega_bn_b)
        except MotionError as error:
            after = step * flight.mission.period_ns * 1e-9
            raise StudyError(f"case {number} of {flight.mission.name}, after {after:g} s: {error}") from error
