# SPDX-License-Identifier: Apache-2.0
"""What each source made in one recorded flight: its sensors are read again along its own truth, without it.

A recording holds its mission, and every draw is a function of seed, case, step and stream. The readings of the flight
can so be made again, with all errors or without some, and given to the estimator that flew: the difference of the
headings is what the source made in that flight. That they are the readings of the recording is checked first.
"""

import math
from collections.abc import Iterator
from pathlib import Path as FilePath
from typing import NamedTuple

import numpy as np

from css_analysis.flight_log import FlightLog, angle, read_flight
from css_analysis.flight_metrics import acquisition
from css_common.mission import Mission
from css_design.budget.measured import Estimate, bound
from css_design.budget.open_loop import Estimates, Path, estimates, path_of, readings
from css_design.budget.sources import (
    FILTER,
    LAYOUT,
    heard_sources,
    is_active,
    refuse_calibrated,
    seeing_everywhere,
    without,
)
from css_design.errors import DesignError
from css_estimation.sun.sun_heading import VALIDITY_NONE
from css_monte_carlo.mission_flight import MissionFlight

BLOCK_S = 60.0
"""Time [s] of the blocks that intervals of one flight are resampled from: longer than errors are alike."""

_DEG = 180.0 / math.pi
_SAME_SHARE = 0.999


class RecordedRow(NamedTuple):
    """A source in one flight; angles in deg."""

    source: str
    alone: float  # root mean square of what it makes of perfect sensors
    left_out: float  # of what is other without it


class Recorded(NamedTuple):
    """The budget of a recording; angles in deg."""

    origin: str
    mission: str
    estimator: str
    case: int
    counted_s: float  # time over which errors are counted
    rows: list[RecordedRow]
    total: float  # root mean square of the recorded heading errors
    bound: Estimate  # 95 % of them
    pointing_total: float
    pointing_bound: Estimate
    remarks: list[str]


def recorded_budget(folder: FilePath) -> Recorded:
    """Splits the heading error of a recording.

    Raises:
        DesignError: it has no truth, no mission or no Sun estimate of the estimator that controlled.
        BagError: it cannot be read.
        MissionError: the compiled loop has no place for something of its mission.
    """
    log = read_flight(folder)
    mission = _mission_of(log)
    name = mission.values.graph.estimator
    flight = MissionFlight(mission)
    path, rows = _path(log, mission, flight)
    remarks = [*log.notes, *_differences(log, mission, path, rows)]
    whole = estimates(flight, path, readings(flight, path))
    said = log.estimates[name]
    recorded = _recorded_estimates(log, name, len(path.truth))
    same = np.mean(np.all(recorded.sun_b == whole.sun_b, axis=1)[recorded.known]) if recorded.known.any() else 0.0
    if same < _SAME_SHARE:
        remarks.append(
            f"{1.0 - same:.1%} of the {len(said)} recorded estimates are others than the mission's estimator makes of "
            "its own sensors: something was changed in flight, and the split is that of the unchanged mission"
        )
    counted = path.counted & recorded.known & whole.known
    if not counted.any():
        raise DesignError(
            f"{folder}: the flight has no sunlit minute with the Sun within 30 deg of the array normal, expected one "
            "that acquired the Sun"
        )
    errors = angle(recorded.sun_b, path.sun_b)
    pointing = log.pointing_error[rows]
    blocks = _blocks(counted, mission.period_ns * 1e-9)
    return Recorded(
        log.origin,
        mission.name,
        name,
        mission.values.mission.case,
        float(np.count_nonzero(counted)) * mission.period_ns * 1e-9,
        list(_split(mission, path, whole, counted)),
        _DEG * _root(errors[counted]),
        _degrees(bound([errors[block] for block in blocks])),
        _DEG * _root(pointing[counted]),
        _degrees(bound([pointing[block] for block in blocks])),
        remarks,
    )


def _mission_of(log: FlightLog) -> Mission:
    if log.imported or log.truth is None:
        raise DesignError(f"{log.origin}: holds no simulated truth, expected a recording of fly or demo")
    if log.mission is None:
        notes = f" ({log.notes[0]})" if log.notes else ""
        raise DesignError(f"{log.origin}: holds no mission{notes}, expected one that was recorded with it")
    refuse_calibrated(log.mission)
    name = log.mission.values.graph.estimator
    if name not in log.estimates:
        raise DesignError(f"{log.origin}: holds no estimates of {name}, expected the topic {name}/sun_estimate")
    return log.mission


def _path(log: FlightLog, mission: Mission, flight: MissionFlight) -> tuple[Path, np.ndarray]:
    """The truth from the epoch on, as long as no stamp is missing, and its rows in the log."""
    truth = log.having("truth")
    steps = (truth.stamp_ns - mission.epoch_ns) / mission.period_ns
    whole = steps == np.arange(len(steps))
    count = len(steps) if whole.all() else int(np.argmin(whole))
    if count < 2:
        raise DesignError(f"{log.origin}: the truth does not begin at mission.epoch, expected a whole recording")
    rows = np.arange(count)
    states = np.concatenate([truth.sigma_bn[:count], truth.omega_bn_b[:count]], axis=1)
    wheels = mission.values.wheels
    speeds = np.zeros((count, len(wheels.axes) if wheels.fitted else 0))
    if log.wheels is not None and speeds.shape[1]:
        ours, theirs = log.truth_rows(log.wheels)
        kept = theirs < count
        speeds[theirs[kept]] = log.wheels.speed[ours[kept]]
    begin = acquisition(log)
    return path_of(flight, mission.values.mission.case, states, speeds, -1 if begin is None else begin), rows


def _differences(log: FlightLog, mission: Mission, path: Path, rows: np.ndarray) -> Iterator[str]:
    """What of the recording is not what its mission makes."""
    lost = len(log.having("truth")) - len(rows)
    if lost:
        yield f"{lost} steps after the first gap of the truth are left out"
    if mission.events:
        yield "scripted events are left out of the split"
    made = readings(MissionFlight(mission), path).voltages
    cells = log.voltages
    if cells is None:
        yield "no cell outputs were recorded: that the sensors are those of the mission is not checked"
        return
    ours, theirs = log.truth_rows(cells)
    kept = theirs < len(made)
    if cells.voltages.shape[1] != made.shape[1]:
        yield f"{cells.voltages.shape[1]} cells were recorded, {made.shape[1]} are in the mission"
        return
    same = float(np.mean(np.all(cells.voltages[ours[kept]] == made[theirs[kept]], axis=1))) if kept.any() else 0.0
    if same < _SAME_SHARE:
        yield f"{1.0 - same:.1%} of the recorded cell outputs are others than the mission makes along this truth"


def _recorded_estimates(log: FlightLog, name: str, count: int) -> Estimates:
    said = log.estimates[name]
    ours, theirs = log.truth_rows(said)
    kept = theirs < count
    sun_b, known = np.zeros((count, 3)), np.zeros(count, bool)
    sun_b[theirs[kept]] = said.sun_b[ours[kept]]
    known[theirs[kept]] = said.validity[ours[kept]] != VALIDITY_NONE
    return Estimates(sun_b, known)


def _split(mission: Mission, path: Path, whole: Estimates, counted: np.ndarray) -> Iterator[RecordedRow]:
    heard = heard_sources(mission)
    perfect = _estimated(without(mission, heard), path)
    for source in heard:
        if is_active(mission, source):
            alone = _estimated(without(mission, [other for other in heard if other != source]), path)
            others = _estimated(without(mission, [source]), path)
            yield RecordedRow(source.name, _apart(alone, perfect, counted), _apart(whole, others, counted))
    dense = seeing_everywhere(without(mission, heard))
    true = Estimates(path.sun_b, np.ones(len(path.sun_b), bool))
    if dense is None:
        yield RecordedRow(FILTER, _apart(perfect, true, counted), math.nan)
        return
    best = _estimated(dense, path)
    every = seeing_everywhere(mission)
    beside = math.nan if every is None else _apart(whole, _estimated(every, path), counted)
    yield RecordedRow(LAYOUT, _apart(perfect, best, counted), beside)
    yield RecordedRow(FILTER, _apart(best, true, counted), math.nan)


def _estimated(mission: Mission, path: Path) -> Estimates:
    flight = MissionFlight(mission)
    return estimates(flight, path, readings(flight, path))


def _apart(one: Estimates, other: Estimates, counted: np.ndarray) -> float:
    """Root mean square [deg] of the angle between the headings of two estimates."""
    both = counted & one.known & other.known
    return _DEG * _root(angle(one.sun_b[both], other.sun_b[both])) if both.any() else math.nan


def _root(errors: np.ndarray) -> float:
    return float(np.sqrt(np.mean(errors**2)))


def _blocks(counted: np.ndarray, period_s: float) -> list[np.ndarray]:
    """Rows of the steps that count, in pieces of a minute."""
    steps = np.flatnonzero(counted)
    numbers = (steps * period_s // BLOCK_S).astype(int)
    return np.split(steps, np.flatnonzero(np.diff(numbers)) + 1)


def _degrees(estimate: Estimate) -> Estimate:
    return Estimate(*(_DEG * value for value in estimate))
