# SPDX-License-Identifier: Apache-2.0
"""How well a flight was estimated and pointed, as O'Keefe & Schaub 2013 measure it (their Figs. 6-8).

Everything is measured against the truth; without a truth in the log every quantity is None. What is measured stands in
`css_analysis.quantities`. Definitions:

sunlit          more than half of the solar disc is in view (truth.illumination > 0.5).
power positive  the true Sun is within 30 deg of the array normal.
acquisition     the first moment from which the flight stays sunlit and power positive for 60 s.
dawn            the first 60 s of sunlight after an eclipse.
detumbled       the first moment from which the body rate stays below `measures.detumbled_rate_deg_s` for 60 s.

Imported telemetry says nothing about solar arrays and orbit: nothing is told of pointing and acquisition, and errors
of estimates count over all of its lines.
"""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from css_analysis.estimate_errors import attitude_errors, estimated_rows, heading_errors
from css_analysis.flight_log import FlightLog
from css_common.mission import Mission

POWER_POSITIVE = np.radians(30.0)
"""Largest angle [rad] between array normal and Sun at which the arrays carry the spacecraft."""
ACQUIRED_AFTER = 60.0
"""Power-positive time [s] that makes an acquisition."""
FINAL_TIME = 60.0
"""Time [s] at the end of the flight over which the final rate is averaged."""
DAWN_TIME = 60.0
"""Time [s] of sunlight after an eclipse in which an estimator has to find its way back."""


class Windows(NamedTuple):
    """When is measured what a mission's `measures` section asks for; 0 where it does not."""

    settled_time: float = 0.0  # [s] from the epoch, after which an attitude filter counts as settled
    late_time: float = 0.0  # [s] sunlit at the end of a flight, of the late heading error
    report_time: float = 0.0  # [s] from the epoch, at which studies state the rates
    detumbled_rate_deg_s: float = 0.0  # body rate below which a spacecraft counts as detumbled


def windows_of(mission: Mission | None) -> Windows:
    """The windows that a mission asks for; of an unknown mission none."""
    if mission is None:
        return Windows()
    measures = mission.values.measures
    return Windows(*(float(getattr(measures, name)) for name in Windows._fields))


def acquisition(log: FlightLog) -> int | None:
    """Step of the truth from which the flight stays sunlit and power positive for 60 s; None if never."""
    return None if log.truth is None else _lasting(log, log.sunlit & (log.pointing_error <= POWER_POSITIVE))


def _lasting(log: FlightLog, flags: np.ndarray) -> int | None:
    """First step of the truth from which a flag holds for 60 s; None if it never does."""
    for first, last in _runs(flags):
        # a hundredth of a step of slack: stamps are whole nanoseconds
        if _span(log, first, last) >= ACQUIRED_AFTER - 0.01 * log.period:
            return first
    return None


def dawn_steps(sunlit: np.ndarray, period_s: float) -> np.ndarray:
    """(K,) True within `DAWN_TIME` of sunlight after an eclipse, of steps (K,) that are sunlit or not."""
    dawn = np.zeros(len(sunlit), bool)
    for first, last in _runs(sunlit):
        if first > 0:
            dawn[first : min(last + 1, first + round(DAWN_TIME / period_s))] = True
    return dawn


class Pass(NamedTuple):
    """One stretch of sunlight."""

    start_s: float  # [s] since the epoch
    end_s: float  # [s] since the epoch
    converging_s: float  # [s] of it with the Sun more than 30 deg off the array normal
    acquired_s: float | None  # [s] from its start to its acquisition, None: not in this stretch


def sunlit_passes(log: FlightLog) -> list[Pass]:
    """The stretches of sunlight: the first holds the first acquisition, the others those after an eclipse."""
    if log.truth is None:
        return []
    time = log.time(log.truth)
    away = log.pointing_error > POWER_POSITIVE
    passes = []
    for first, last in _runs(log.sunlit):
        within = _runs(~away[first : last + 1])
        slack = ACQUIRED_AFTER - 0.01 * log.period
        start = next((first + a for a, b in within if _span(log, first + a, first + b) >= slack), None)
        acquired = None if start is None else float(time[start] - time[first])
        converging = float(np.count_nonzero(away[first : last + 1])) * log.period
        passes.append(Pass(float(time[first]), float(time[last]), converging, acquired))
    return passes


class FlightMeasures:
    """What is measured of a flight, whatever its estimators; None: it cannot be said."""

    def __init__(self, log: FlightLog) -> None:
        self.log = log
        self.windows = windows_of(log.mission)

    @cached_property
    def counted(self) -> np.ndarray:
        """(M,) True at the sunlit steps of the truth from acquisition on."""
        counted = self.log.sunlit.copy()
        if self.log.imported:
            return counted
        start = acquisition(self.log)
        counted[: len(counted) if start is None else start] = False
        return counted

    @cached_property
    def knows_arrays(self) -> bool:
        """Whether the log says where the solar arrays are."""
        return self.log.truth is not None and not self.log.imported

    def power_positive_s(self) -> float | None:
        """Sunlit time [s] away from power positive."""
        if not self.knows_arrays:
            return None
        away, sunlit = self.log.pointing_error > POWER_POSITIVE, self.log.sunlit
        return float(np.count_nonzero(away & sunlit)) * self.log.period if np.any(~away & sunlit) else None

    def pointing_error_mean_deg(self) -> float | None:
        """Mean pointing error after acquisition."""
        return _mean_deg(self.log.pointing_error[self.counted]) if self.knows_arrays else None

    def pointing_error_sunlit_deg(self) -> float | None:
        """Mean pointing error in sunlight."""
        return _mean_deg(self.log.pointing_error[self.log.sunlit]) if self.knows_arrays else None

    def power_positive_from_s(self) -> float | None:
        """Time from which the Sun stays within 30 deg of the array normal in all sunlight that is left."""
        if not self.knows_arrays:
            return None
        within = np.flatnonzero(self.log.sunlit & (self.log.pointing_error <= POWER_POSITIVE))
        away = np.flatnonzero(self.log.sunlit & (self.log.pointing_error > POWER_POSITIVE))
        kept = within if len(away) == 0 else within[within > away[-1]]
        return self._time_of(int(kept[0])) if len(kept) else None

    def power_positive_late(self) -> float | None:
        """Share of the last `Windows.late_time` of sunlight with the Sun within 30 deg of the array normal."""
        if not self.knows_arrays or self.windows.late_time == 0.0 or self.log.period == 0.0:
            return None
        late = np.flatnonzero(self.log.sunlit)[-max(1, round(self.windows.late_time / self.log.period)) :]
        return float(np.mean(self.log.pointing_error[late] <= POWER_POSITIVE)) if len(late) else None

    def detumbled_s(self) -> float | None:
        """Time from which the body rate stays low for 60 s."""
        if not self.log.knows("rate"):
            return None
        return self._time_of(_lasting(self.log, self.log.rate < np.radians(self.windows.detumbled_rate_deg_s)))

    def rod_dipole_mean(self) -> float | None:
        """Mean over the flight of the dipoles of all rods, without their signs."""
        commands = self.log.rod_command
        return None if commands is None else float(np.mean(np.sum(np.abs(commands.dipole), axis=1)))

    def _time_of(self, step: int | None) -> float | None:
        truth = self.log.truth
        return None if step is None or truth is None else float(self.log.time(truth)[step])

    def rate_final_deg_s(self) -> float | None:
        """Mean rate at the end."""
        truth = self.log.truth
        if truth is None or not self.log.knows("rate"):
            return None
        time = self.log.time(truth)
        return _mean_deg(self.log.rate[time > time[-1] - FINAL_TIME + 0.01 * self.log.period])


class EstimatorMeasures:
    """What is measured of one estimator in a flight; None: it cannot be said."""

    def __init__(self, flight: FlightMeasures, name: str) -> None:
        self.flight = flight
        self.name = name
        self._log = flight.log

    def heading_error_mean_deg(self) -> float | None:
        """Mean heading error after acquisition."""
        return _mean_deg(self._acquired_errors)

    def heading_error_p95_deg(self) -> float | None:
        """95th percentile of the heading error after acquisition."""
        return _p95_deg(self._acquired_errors)

    def heading_error_sunlit_deg(self) -> float | None:
        """Mean heading error in sunlight."""
        if self._headings is None:
            return None
        steps, errors = self._headings
        return _mean_deg(errors[self._log.sunlit[steps]])

    def heading_error_eclipse_deg(self) -> float | None:
        """Mean heading error in eclipse."""
        if self._headings is None or not self._log.knows("illumination"):
            return None
        steps, errors = self._headings
        return _mean_deg(errors[~self._log.sunlit[steps]])

    def heading_error_dawn_deg(self) -> float | None:
        """Mean heading error in the first minute after an eclipse."""
        if self._headings is None or not self._log.knows("illumination") or self._log.period == 0.0:
            return None
        steps, errors = self._headings
        return _mean_deg(errors[dawn_steps(self._log.sunlit, self._log.period)[steps]])

    def attitude_error_mean_deg(self) -> float | None:
        """Mean attitude error of a settled filter."""
        return _mean_deg(self._settled[0])

    def attitude_error_p95_deg(self) -> float | None:
        """95th percentile of the attitude error of a settled filter."""
        return _p95_deg(self._settled[0])

    def attitude_nees(self) -> float | None:
        """Mean normalised error squared of a settled filter."""
        squared = self._settled[1]
        return float(np.mean(squared)) if len(squared) else None

    def steps_without_estimate(self) -> int | None:
        """Sunlit steps without an estimate."""
        if self._log.truth is None:
            return None
        without = self._log.sunlit.copy()
        without[estimated_rows(self._log, self.name)[1]] = False
        return int(np.count_nonzero(without))

    @cached_property
    def _headings(self) -> tuple[np.ndarray, np.ndarray] | None:
        known = self._log.truth is not None and self.name in self._log.estimates
        return heading_errors(self._log, self.name) if known else None

    @cached_property
    def _acquired_errors(self) -> np.ndarray:
        if self._headings is None:
            return _NONE
        steps, errors = self._headings
        return errors[self.flight.counted[steps]]

    @cached_property
    def _settled(self) -> tuple[np.ndarray, np.ndarray]:
        """Errors [rad] and normalised errors squared from `Windows.settled_time` on."""
        truth = self._log.truth
        if truth is None or self.name not in self._log.attitudes or not self._log.knows("attitude"):
            return _NONE, _NONE
        steps, errors, squared = attitude_errors(self._log, self.name)
        settled = self._log.time(truth)[steps] >= self.flight.windows.settled_time - 0.01 * self._log.period
        return errors[settled], squared[settled]


_NONE = np.zeros(0)


def _runs(flags: np.ndarray) -> list[tuple[int, int]]:
    """First and last index of each stretch of True."""
    edges = np.diff(np.concatenate(([0], flags.astype(np.int8), [0])))
    firsts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    return list(zip(firsts.tolist(), (ends - 1).tolist(), strict=True))


def _span(log: FlightLog, first: int, last: int) -> float:
    """Time [s] from one step of the truth to another."""
    stamps = log.having("truth").stamp_ns
    return float(stamps[last] - stamps[first]) * 1e-9


def _mean_deg(angles: np.ndarray) -> float | None:
    return float(np.degrees(np.mean(angles))) if len(angles) else None


def _p95_deg(angles: np.ndarray) -> float | None:
    return float(np.degrees(np.percentile(angles, 95.0))) if len(angles) else None
