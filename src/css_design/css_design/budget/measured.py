# SPDX-License-Identifier: Apache-2.0
"""The same split by the Monte Carlo: sources switched on one at a time, and all but one.

Every configuration flies the same cases with the same draws. Of each flight the mean square of the errors is kept over
all sunlit steps after its acquisition; a source alone is the mean square with it less that without any, a source
left out the mean square with all less that without it. Intervals are of a bootstrap over the cases (Efron 1979).
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from css_common.mission import Mission, MissionError
from css_design.budget.sources import FILTER, LAYOUT, Source, heard_sources, is_active, seeing_everywhere, without
from css_monte_carlo.case_tallies import SAMPLED, SUNLIT
from css_monte_carlo.chunk import fly_cases
from css_monte_carlo.flight_threads import FlightThreads
from css_monte_carlo.mission_flight import MissionFlight

RESAMPLES = 2000
CONFIDENCE = 0.95
SAMPLE_S = 2.0
"""Time [s] between the samples of a flight."""

ALL, NONE, EVERYWHERE, ALL_EVERYWHERE = "all", "none", "none, cells everywhere", "all, cells everywhere"
_SEED = 20130601
_SHARE = 5  # cases that a thread flies at a time
_AT_HEADING, _AT_POINTING = SAMPLED.index("heading_error_deg"), SAMPLED.index("pointing_error_deg")
_DEG = np.pi / 180.0


class Errors(NamedTuple):
    """Of C cases of one configuration."""

    heading: np.ndarray  # (C,) mean squares [rad^2]; NaN: never acquired, or no estimate
    pointing: np.ndarray  # (C,) the same
    samples: list[np.ndarray]  # of each case: heading errors [rad] at the samples that count
    pointing_samples: list[np.ndarray]


class Estimate(NamedTuple):
    """A number of the Monte Carlo with its interval of 95 %."""

    value: float
    low: float
    high: float


Tell = Callable[[int, int], None]


def configurations(mission: Mission) -> dict[str, Mission]:
    """The missions that are flown, by name: `+source` is that source alone, `-source` all but it."""
    heard = heard_sources(mission)
    active = [source for source in heard if is_active(mission, source)]
    ideal = without(mission, heard)
    flown = {ALL: mission, NONE: ideal}
    for source in active:
        flown[f"+{source.name}"] = without(mission, [other for other in heard if other != source])
        flown[f"-{source.name}"] = without(mission, [source])
    for name, of in ((EVERYWHERE, ideal), (ALL_EVERYWHERE, mission)):
        dense = seeing_everywhere(of)
        if dense is not None:
            flown[name] = dense
    return flown


def fly(missions: dict[str, Mission], cases: int, tell: Tell) -> dict[str, Errors]:
    """Errors of cases 0 to `cases` - 1 of each mission.

    Raises:
        MissionError: the compiled loop has no place for something of a mission.
    """
    numbers = [np.arange(first, min(first + _SHARE, cases)) for first in range(0, cases, _SHARE)]
    flights = {name: MissionFlight(mission) for name, mission in missions.items()}
    # compiled, or loaded, before threads ask for it all at once
    done, total = 0, cases * len(flights)
    results: dict[str, list[Errors]] = {name: [] for name in flights}
    with FlightThreads() as pool:
        futures = [
            (name, len(part), pool.submit(_fly, flight, part)) for name, flight in flights.items() for part in numbers
        ]
        for name, count, future in futures:
            results[name].append(future.result())
            done += count
            tell(done, total)
    return {name: _joined(parts) for name, parts in results.items()}


def _fly(flight: MissionFlight, numbers: np.ndarray) -> Errors:
    period_s = flight.mission.period_ns * 1e-9
    every = max(1, round(SAMPLE_S / period_s))
    tallies: Any = fly_cases(flight, numbers, every).tallies
    if tallies.samples.shape[1] != len(SAMPLED):
        raise MissionError(f"{flight.mission.origin}: graph.estimator estimates no Sun, expected a Sun estimator")
    found = []
    for row, number in enumerate(numbers):
        marks = flight.around_case(int(number)).marks if flight.own_surroundings else flight.marks
        steps = np.arange(tallies.samples.shape[2]) * every
        acquired = int(tallies.totals["acquired_step"][row])
        counted = ((marks[steps] & SUNLIT) != 0) & (steps >= acquired) & (acquired >= 0)
        found.append(
            [tallies.samples[row, at][counted].astype(np.float64) * _DEG for at in (_AT_HEADING, _AT_POINTING)]
        )
    heading = [samples[np.isfinite(samples)] for samples, _ in found]
    pointing = [samples for _, samples in found]
    return Errors(_mean_squares(heading), _mean_squares(pointing), heading, pointing)


def _mean_squares(samples: Sequence[np.ndarray]) -> np.ndarray:
    return np.array([np.mean(part**2) if len(part) else np.nan for part in samples])


def _joined(parts: Sequence[Errors]) -> Errors:
    heading, pointing = (np.concatenate([part[i] for part in parts]) for i in range(2))
    return Errors(
        heading,
        pointing,
        [samples for part in parts for samples in part.samples],
        [samples for part in parts for samples in part.pointing_samples],
    )


def root_mean_square(squares: np.ndarray, less: np.ndarray | None = None) -> Estimate:
    """Root of the mean over the cases of mean squares (C,), less others of the same cases, with its interval.

    A mean below zero is one of -0: the root of its size with the sign.
    """
    values = squares if less is None else squares - less
    values = values[np.isfinite(values)]
    if not len(values):
        return Estimate(np.nan, np.nan, np.nan)
    draws = np.random.default_rng(_SEED).integers(0, len(values), (RESAMPLES, len(values)))
    means = values[draws].mean(axis=1)
    low, high = np.quantile(means, (0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE)))
    return Estimate(*(_signed_root(float(v)) for v in (values.mean(), low, high)))


def _signed_root(value: float) -> float:
    return float(np.copysign(np.sqrt(abs(value)), value))


def bound(samples: Sequence[np.ndarray], share: float = 0.95) -> Estimate:
    """Error [rad] below which a share of all samples lies, with its interval by resampled cases."""
    parts = [np.sort(part) for part in samples if len(part)]
    if not parts:
        return Estimate(np.nan, np.nan, np.nan)
    everything = np.concatenate(parts)
    # each case by its counts in common bins, so that a resample is a sum
    edges = np.concatenate([[0.0], np.quantile(everything, np.linspace(0.0, 1.0, 2001))[1:-1], [np.inf]])
    edges = np.unique(edges)
    counts = np.stack([np.histogram(part, edges)[0] for part in parts])
    draws = np.random.default_rng(_SEED).integers(0, len(parts), (RESAMPLES, len(parts)))
    at = []
    for draw in draws:
        cumulated = np.cumsum(counts[draw].sum(axis=0))
        at.append(edges[min(int(np.searchsorted(cumulated, share * cumulated[-1])) + 1, len(edges) - 2)])
    low, high = np.quantile(at, (0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE)))
    return Estimate(float(np.quantile(everything, share)), float(low), float(high))


class Split(NamedTuple):
    """What a source makes of one error, by the Monte Carlo [rad]."""

    alone: Estimate  # with it less without any
    left_out: Estimate  # with all less without it


def split(flown: dict[str, Errors], active: Sequence[Source], kind: str) -> dict[str, Split]:
    """Contributions by source; `kind` is `heading` or `pointing`."""

    def of(name: str) -> np.ndarray:
        return np.asarray(getattr(flown[name], kind))

    found = {
        source.name: Split(
            root_mean_square(of(f"+{source.name}"), of(NONE)), root_mean_square(of(ALL), of(f"-{source.name}"))
        )
        for source in active
    }
    nothing = Estimate(np.nan, np.nan, np.nan)
    if EVERYWHERE not in flown:
        found[FILTER] = Split(root_mean_square(of(NONE)), nothing)
        return found
    found[LAYOUT] = Split(root_mean_square(of(NONE), of(EVERYWHERE)), root_mean_square(of(ALL), of(ALL_EVERYWHERE)))
    found[FILTER] = Split(root_mean_square(of(EVERYWHERE)), nothing)
    return found
