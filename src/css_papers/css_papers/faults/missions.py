# SPDX-License-Identifier: Apache-2.0
"""What flies: missions as they are, over dates, attitudes, rates, clouds and cells that nobody has calibrated."""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from css_common.mission import Mission, MissionError, load_mission
from css_monte_carlo.study import Configuration
from css_papers.faults.kinds import (
    BOARD,
    CELL,
    GYRO,
    MAGNETOMETER,
    NONE,
    PAIR,
    ROD,
    WHEEL,
    Fault,
    board_fault,
    cell_faults,
    gyro_faults,
    magnetometer_faults,
    pairs,
    rod_faults,
    wheel_faults,
)

_CALIBRATION = ("css_array.scale_cell_error=0.02", "css_array.misalignment_deg=1")
_CLOUDS = ("css_array.albedo.draw=per_cell",)
_DATES = ("mission.epoch_spread_days=365",)
_ENDS_IN_POWER = ("measures.detumbled_rate_deg_s=4",)  # with it a study says whether a flight ends in power
_OKEEFE = (*_CALIBRATION, *_CLOUDS, "css_array.noise=0.005", *_ENDS_IN_POWER)
_TOLD = ("sun_filter.gain_sigma=0.02", "sun_filter.tilt_sigma_deg=1", "sun_filter.calibration.mode=consider")
_FIELD = (
    "graph.nodes=css_sim/dynamics,css_sim/css_array,css_sim/gyro,css_sim/magnetometer,css_estimation/ekf,"
    "sunpoint_control/mrp_control",
    "magnetometer.divider=10",
)
_ANY_RATE = ("dynamics.initial.rate=direction", "dynamics.initial.rate_deg_s=1.7")
_QUICK_S = 900.0
_CELLS = (CELL, BOARD, PAIR)


class Subject(NamedTuple):
    """One mission with one estimator."""

    label: str
    mission: str
    estimator: str
    gyro: bool
    base: tuple[str, ...]  # what makes the mission of all its cases
    changes: tuple[str, ...]  # on top of it, once all nodes are there
    sorts: tuple[str, ...]  # of faults that it flies
    within_s: float  # faults begin by then
    board: str = ""  # cells that share one
    rod_dipole: float = 0.1  # [A m^2] at which rods are stuck: half of what they can
    quick: bool = False

    def loaded(self, quick: bool) -> Mission:
        """The mission that all its lines have in common."""
        mission = load_mission(self.mission, list(self.base))
        short = (f"mission.duration={_QUICK_S:g}",) if quick else _DATES
        return mission.with_overrides([*self.changes, *short])

    def faults(self, quick: bool) -> list[Fault]:
        """The lines, that without a fault first."""
        chosen = [NONE, *(fault for sort in self.sorts for fault in self._of(sort))]
        return [fault for fault in chosen if fault.quick or not quick]

    def configuration(self, fault: Fault, quick: bool) -> Configuration:
        """How the cases of a line fly."""
        within_s = min(self.within_s, _QUICK_S / 3.0) if quick else self.within_s
        return Configuration(self.estimator, self.gyro, fault.overrides(within_s))

    def _of(self, sort: str) -> Iterable[Fault]:
        if sort == BOARD:
            return [board_fault(self.board)] if self.board else []
        return rod_faults(self.rod_dipole) if sort == ROD else _FAULTS[sort]()


_FAULTS = {
    CELL: cell_faults,
    PAIR: pairs,
    WHEEL: wheel_faults,
    GYRO: gyro_faults,
    MAGNETOMETER: magnetometer_faults,
}


def subjects() -> list[Subject]:
    """All of the page, in its order."""
    return [
        Subject(
            "ekf", "okeefe_2013", "ekf", True, (), _OKEEFE, (*_CELLS, WHEEL, GYRO), 2500.0, board="0-3", quick=True
        ),
        Subject("wavg", "okeefe_2013", "wavg", True, (), _OKEEFE, _CELLS, 2500.0, board="0-3", quick=True),
        Subject(
            "ekf with field",
            "okeefe_2013",
            "ekf",
            True,
            _FIELD,
            (*_OKEEFE, "ekf.rate.use_field=true"),
            (GYRO, MAGNETOMETER),
            2500.0,
        ),
        Subject(
            "sun_filter",
            "okeefe_sun_filter",
            "sun_filter",
            True,
            (),
            (*_OKEEFE, *_TOLD),
            (*_CELLS, WHEEL, GYRO),
            2500.0,
            board="0-3",
        ),
        Subject(
            "Clark, pyramid",
            "clark_1996_pyramid",
            "pyramid_switch",
            False,
            (),
            (*_CALIBRATION, *_ANY_RATE, *_ENDS_IN_POWER, "mission.duration=11290"),
            (*_CELLS, WHEEL, ROD, MAGNETOMETER),
            6000.0,
            board="11-13",
            rod_dipole=10.0,
        ),
        Subject(
            "3U, safe", "cubesat_3u_safe", "wls", False, (), _CLOUDS, (*_CELLS, ROD, MAGNETOMETER), 9000.0, board="0-1"
        ),
        Subject(
            "3U, sun_filter",
            "cubesat_3u_sun_filter",
            "sun_filter",
            False,
            (),
            _CLOUDS,
            (*_CELLS, ROD, MAGNETOMETER),
            9000.0,
            board="0-1",
        ),
    ]


class Absent(NamedTuple):
    """A mission that does not have some of its cells."""

    cells: tuple[int, ...]
    configuration: Configuration


def absent(subject: Subject, mission: Mission, cells: tuple[int, ...]) -> Absent:
    """How a mission flies whose layout never had some cells; one without a cell of its pyramid does without it."""
    collared = [int(i) for i in mission.node("css_array").values.collar.cells]
    if set(cells) & set(collared):
        # three orthogonal cells can never be that bright together: the flat ones are left
        return Absent(cells, Configuration(subject.estimator, subject.gyro, ("pyramid_switch.pyramid.minimum=1",)))
    normals = np.asarray(mission.values.cells.normals).reshape(-1, 3)
    left = [i for i in range(len(normals)) if i not in cells]
    overrides = [f"cells.normals={','.join(f'{c:.17g}' for c in normals[left].ravel())}"]
    if collared:
        overrides.append(f"css_array.collar.cells={','.join(str(left.index(i)) for i in collared)}")
    return Absent(cells, Configuration(subject.estimator, subject.gyro, tuple(overrides)))


def absents(subject: Subject, mission: Mission) -> Iterator[Absent]:
    """A mission for each cell that it may lack, and for its board; none where its estimator cannot do without."""
    count = len(np.asarray(mission.values.cells.normals).reshape(-1, 3))
    sets: list[tuple[int, ...]] = [(cell,) for cell in range(count)]
    if subject.board:
        first, last = map(int, subject.board.split("-"))
        sets.append(tuple(range(first, last + 1)))
    for cells in sets:
        lacking = absent(subject, mission, cells)
        with suppress(MissionError):
            lacking.configuration.applied(mission)
            yield lacking
