# SPDX-License-Identifier: Apache-2.0
"""The worst flight that can be found: a search over dispersed parameters and over the cases' own draws.

Differential evolution (Storn & Price 1997) starts from the worst cases of a study and moves their parameters, a normal
one within 3 sigma. Numbers of cases are names, not quantities: a child flies the draws of one of its parents.
"""

import math
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import differential_evolution

from css_analysis.errors import StudyError
from css_analysis.flight_metrics import windows_of
from css_analysis.study_summary import rows_of, summaries_of
from css_common.drawn_mission import values_at
from css_common.mission import Mission, MissionError
from css_common.mission_section import name_for_files
from css_common.preflight import preflight
from css_common.sampling import sample_of
from css_common.schema import ParameterError
from css_common.whole_files import write_whole
from css_monte_carlo.case_missions import share_surroundings
from css_monte_carlo.case_table import case_table
from css_monte_carlo.chunk import fly_cases
from css_monte_carlo.flight_threads import FlightThreads
from css_monte_carlo.measures import CaseTallies
from css_monte_carlo.mission_flight import MissionFlight
from css_monte_carlo.mission_parts import NoPlace
from css_monte_carlo.stepped_flight import SteppedFlight
from css_monte_carlo.study import Configuration, Study

FILE = "worst.yaml"
"""Mission of the worst case in the folder of a study of one configuration; of several each has one of its name."""

_EDGE = 0.5 * math.erfc(3.0 / math.sqrt(2.0))  # 3 sigma of a normal parameter
_LEAST_PARENTS = 8
_CANNOT_FLY = -math.inf


class Worst(NamedTuple):
    """The worst flight found.

    Attributes:
        labels: estimator, gyro, overrides.
        quantity: column of the table of cases; the largest is worst, and none at all worse than any.
        value: of the flight, None where it never came.
        in_study: the worst of the study.
        case: whose own draws it flies.
        drawn: dispersed parameters by key.
        mission: file that flies it, on the graph too.
        flights: flown in the search.
        interrupted: the search was ended before its time.
    """

    labels: dict[str, Any]
    quantity: str
    value: float | None
    in_study: float | None
    case: int
    drawn: dict[str, Any]
    mission: Path
    flights: int
    interrupted: bool

    def as_object(self) -> dict[str, Any]:
        """What `--json` says."""
        return {
            **self.labels,
            "quantity": self.quantity,
            "value": self.value,
            "worst_of_study": self.in_study,
            "case": self.case,
            "drawn": self.drawn,
            "mission": str(self.mission),
            "command": self.command,
            "flights": self.flights,
            "interrupted": self.interrupted,
        }

    @property
    def command(self) -> str:
        """What flies it on the real graph."""
        return f"./sunpoint fly {self.mission}"


def find_worst(
    mission: Mission,
    configuration: Configuration,
    study: Study,
    flights: int,
    quantity: str = "",
    *,
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Worst:
    """Searches from the worst cases of a study on; Ctrl-C ends the search with the worst so far.

    Args:
        mission: as the study flew it.
        configuration: one of its.
        flights: how many the search may fly.
        quantity: column of the table of cases; empty: the first that is told of the estimator.

    Raises:
        StudyError: there is no such quantity.
    """
    name = quantity or summaries_of(study, configuration.estimator)[0].of
    if name not in study.cases.column_names:
        raise StudyError(f"--worst: {name} given, expected one of {', '.join(study.cases.column_names)}")
    search = _Search(configuration.applied(mission), configuration.estimator, name, flights, progress)
    of_study = rows_of(study.cases, **configuration.columns)
    values = [_badness(value) for value in of_study[name].to_pylist()]
    search.begin(of_study["case"].to_pylist(), values)
    interrupted = False
    try:
        search.run(threads)
    except KeyboardInterrupt:
        interrupted = True
    flown, file = search.mission_of(search.worst), study.folder / _file_name(configuration, study)
    write_whole(file, flown.text())
    return Worst(
        configuration.columns,
        name,
        _value(search.worst.badness),
        _value(max(values)),
        flown.values.mission.case,
        search.worst.drawn,
        file,
        search.flown,
        interrupted,
    )


def _file_name(configuration: Configuration, study: Study) -> str:
    if len(study.manifest["configurations"]) == 1:
        return FILE
    gyro = "gyro" if configuration.gyro else "no_gyro"
    return f"{name_for_files('_'.join(['worst', configuration.estimator, gyro, *configuration.overrides]))}.yaml"


def _badness(value: float | None) -> float:
    return math.inf if value is None or math.isnan(value) else float(value)


def _value(badness: float) -> float | None:
    return badness if math.isfinite(badness) else None


class _Flight(NamedTuple):
    badness: float
    case: int  # whose own draws
    drawn: dict[str, Any]


class _Search:
    """Flights of one configuration that are compared."""

    def __init__(
        self,
        mission: Mission,
        estimator: str,
        quantity: str,
        flights: int,
        progress: Callable[[int, int], None] | None,
    ) -> None:
        self._mission, self._estimator, self._quantity = mission, estimator, quantity
        self._base: MissionFlight | None = None  # None: flown node by node
        with suppress(NoPlace):
            self._base = MissionFlight(mission, estimator)
        alike = self._base is not None and not self._base.own_places and share_surroundings(mission.dispersions)
        self._surrounded_as = self._base if alike else None
        self._most, self._progress = flights, progress
        self._lock = threading.Lock()
        self.flown = 0
        self.worst = _Flight(-math.inf, 0, {})

    def begin(self, cases: list[int], values: list[float]) -> None:
        """Takes the worst cases of a study for the first generation."""
        m = self._mission
        dimensions = sum(one.draws for one in m.dispersions)
        count = min(len(cases), max(_LEAST_PARENTS, min(8 * dimensions, self._most // 4)))
        order = sorted(range(len(cases)), key=lambda i: -values[i])[:count]
        rows = []
        for i in order:
            sample = sample_of(m.dispersions, m.values.sampling, m.values.mission.seed, cases[i])
            rows.append((sample.points, sample.own_case))
        self._own_cases = [own for _, own in rows]
        # the case goes as a number of the list, so that a mean of two parents is one of the worst cases too
        self._first = np.array([[*np.clip(p, _EDGE, 1.0 - _EDGE), j] for j, (p, _) in enumerate(rows)], dtype=float)
        points, own = rows[0]
        self.worst = _Flight(values[order[0]], own, values_at(m, points))

    def run(self, threads: int | None) -> None:
        """Flies generation after generation."""
        dimensions = self._first.shape[1] - 1
        if dimensions == 0 or len(self._first) < 5 or self._most < 2 * len(self._first):
            return  # nothing to move: the worst of the study is the worst
        bounds = [(_EDGE, 1.0 - _EDGE)] * dimensions + [(0, len(self._own_cases) - 1)]
        with FlightThreads(threads) as pool:
            differential_evolution(
                self._cost,
                bounds,
                init=self._first,
                maxiter=self._most // len(self._first) - 1,
                tol=0.0,
                polish=False,
                integrality=[False] * dimensions + [True],
                updating="deferred",
                workers=pool.map,
                rng=np.random.default_rng(self._mission.values.mission.seed),
            )

    def mission_of(self, flight: _Flight) -> Mission:
        """The mission of a flight."""
        return self._mission.with_drawn(flight.drawn, flight.case)

    def _cost(self, x: np.ndarray) -> float:
        flight = self._fly(x)
        with self._lock:
            self.flown += 1
            # a rule for equals, or threads would decide
            self.worst = max(self.worst, flight, key=lambda f: (f.badness, -f.case, repr(f.drawn)))
            if self._progress is not None:
                self._progress(min(self.flown, self._most), self._most)
        return -min(flight.badness, 1e300)

    def _fly(self, x: np.ndarray) -> _Flight:
        case = self._own_cases[round(float(x[-1]))]
        try:
            drawn = values_at(self._mission, x[:-1])
            mission = self._mission.with_drawn(drawn, case)
            preflight(mission)
        except (ParameterError, MissionError):
            return _Flight(_CANNOT_FLY, case, {})
        try:
            tallies = self._tallies(mission, np.array([case]))
        except StudyError:
            return _Flight(_CANNOT_FLY, case, {})
        table = case_table(np.array([case]), tallies, mission.period_ns * 1e-9, windows_of(mission))
        return _Flight(_badness(table[self._quantity][0].as_py()), case, drawn)

    def _tallies(self, mission: Mission, case: np.ndarray) -> CaseTallies:
        if self._base is None:
            return SteppedFlight(mission, self._estimator).fly(case, mission.steps)[0]
        flight = MissionFlight(mission, self._estimator, self._surrounded_as)
        return fly_cases(flight, case, mission.steps).tallies
