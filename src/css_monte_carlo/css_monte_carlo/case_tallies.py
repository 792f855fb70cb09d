# SPDX-License-Identifier: Apache-2.0
"""Figures of merit of each case with a Sun estimator, gathered while it flies.

Definitions are those of `css_analysis.flight_metrics`.
"""

import math
from typing import NamedTuple

import numpy as np

from css_analysis.estimate_errors import tangent_nees_of
from css_analysis.flight_log import SUNLIT_FRACTION
from css_analysis.flight_metrics import ACQUIRED_AFTER, FINAL_TIME, POWER_POSITIVE, Windows, dawn_steps
from css_common.kernel import kernel
from css_common.vectors import angle_between, norm, subtract
from css_estimation.sun.sun_heading import VALIDITY_NONE, SunHeading
from css_monte_carlo.health_tallies import ActuatorsLeft, HealthTallies, Held, held_sensors, new_health, tally_health
from css_monte_carlo.step_truth import Truth

REPORT_SPAN = 60.0
"""Time [s] before `Windows.report_time` over which rates are averaged."""

# What is special about a step, the same for all cases.
SUNLIT, FIRST_PASS, LATE, REPORTED, FINAL, DAWN = 1, 2, 4, 8, 16, 32

BIN_DEG = 0.02
"""Width of the bins from which percentiles over time come."""
BINS = round(180.0 / BIN_DEG)

SAMPLED = ("heading_error_deg", "pointing_error_deg", "rate_deg_s", "rate_knowledge_deg_s")
"""Quantities whose percentiles over the cases are kept against time."""

_POWER_POSITIVE_DEG = math.degrees(POWER_POSITIVE)
_DEG = 180.0 / math.pi

TALLY = np.dtype(
    [
        (name, np.int64)
        for name in (
            "away_first",  # steps beyond 30 deg in the first sunlit pass
            "away_later",
            "within",  # sunlit steps within 30 deg
            "acquired_step",  # -1: not yet
            "run",  # sunlit and power positive steps in a row, until acquisition
            "headings",  # sunlit steps after acquisition with an estimate, and the sums over them
            "pointings",
            "sunlit_headings",  # sunlit steps with an estimate, those before acquisition included
            "dark",  # steps in eclipse with an estimate
            "dawn",  # steps in the first minute of sunlight after an eclipse with an estimate
            "late",
            "late_lit",  # late steps, and those of them within 30 deg
            "late_within",
            "kept_step",  # first sunlit step within 30 deg after the last beyond; -1: none
            "slow_run",  # steps below the detumbled rate in a row, until it is detumbled
            "detumbled_step",  # -1: not yet
            "steps",
            "reported",
            "final",
            "without_estimate",
            "innovations",
            "consistencies",
        )
    ]
    + [
        (name, np.float64)
        for name in (
            "heading_sum",
            "pointing_sum",
            "sunlit_heading_sum",
            "sunlit_pointing_sum",
            "late_sum",
            "dark_sum",
            "dawn_sum",
            "reported_sum",
            "reported_knowledge_sum",
            "final_sum",
            "momentum_max",
            "momentum",
            "dipole_sum",
            "nis_sum",
            "nees_sum",
        )
    ],
    align=True,
)
"""Running sums of one case; angles in deg, rates in deg/s, momentum in N m s, dipoles in A m^2."""


ESTIMATE_COLUMNS = 6
"""Columns of a trace that hold the estimate: sun_b and omega_bn_b."""


class Tallies(NamedTuple):
    """Running figures of C cases."""

    totals: np.ndarray  # (C,) of TALLY
    histogram: np.ndarray  # (C, bins) heading errors after acquisition
    pending: np.ndarray  # (C, 2, P) heading and pointing errors of a run that may become the acquisition
    samples: np.ndarray  # (C, quantities, S) float32
    health: HealthTallies
    acquire_steps: int  # a run of more steps than this is an acquisition
    sample_every: int  # steps from sample to sample
    detumbled_rate: float  # [deg/s]


def new_tallies(
    cases: int, steps: int, period_s: float, sample_every: int, detumbled_rate_deg_s: float = 0.0
) -> Tallies:
    """Nothing seen yet, for flights of so many steps."""
    # the hundredth of a step of slack that `flight_metrics` gives
    acquire_steps = math.ceil(ACQUIRED_AFTER / period_s - 0.01)
    totals = np.zeros(cases, TALLY)
    for step in ("acquired_step", "kept_step", "detumbled_step"):
        totals[step] = -1
    return Tallies(
        totals,
        np.zeros((cases, BINS), np.int64),
        np.zeros((cases, 2, acquire_steps + 1)),
        np.full((cases, len(SAMPLED), sample_count(steps, sample_every)), np.nan, np.float32),
        new_health(cases),
        acquire_steps,
        sample_every,
        detumbled_rate_deg_s,
    )


def sample_count(steps: int, sample_every: int) -> int:
    """Number of samples of a flight: at step 0 and every so many steps."""
    return (steps + sample_every - 1) // sample_every


def step_marks(illumination: np.ndarray, period_s: float, windows: Windows) -> np.ndarray:
    """(K,) marks SUNLIT, FIRST_PASS, LATE, REPORTED, FINAL and DAWN of the steps of a flight."""
    steps = np.arange(len(illumination))
    lit = illumination > SUNLIT_FRACTION
    marks = np.where(lit, SUNLIT, 0)
    marks |= np.where(dawn_steps(lit, period_s), DAWN, 0)
    if lit.any():
        begin = int(np.argmax(lit))
        end = begin + int(np.argmin(lit[begin:])) if not lit[begin:].all() else len(lit)
        marks |= np.where((steps >= begin) & (steps < end), FIRST_PASS, 0)
        if windows.late_time > 0.0:
            late = np.flatnonzero(lit)[-max(1, round(windows.late_time / period_s)) :]
            marks[late] |= LATE
    elapsed_s = steps * period_s
    slack = 0.01 * period_s
    report = windows.report_time
    if 0.0 < report <= elapsed_s[-1] + slack:
        marks |= np.where((elapsed_s > report - REPORT_SPAN + slack) & (elapsed_s <= report + slack), REPORTED, 0)
    marks |= np.where(elapsed_s > elapsed_s[-1] - FINAL_TIME + slack, FINAL, 0)
    return marks.astype(np.int64)


@kernel
def note_estimate(heading: SunHeading, attitude, out) -> None:
    """Writes the `ESTIMATE_COLUMNS` of a trace."""
    for i in range(3):
        out[i], out[3 + i] = heading.sun_b[i], heading.omega_bn_b[i]


@kernel
def tally_step(
    tallies: Tallies,
    c: int,
    step: int,
    marks: int,
    truth: Truth,
    heading: SunHeading,
    attitude,
    memory,
    left: ActuatorsLeft,
) -> None:
    """Count one step of case `c`.

    Args:
        marks: of the step, see `step_marks`.
        heading: what the Sun estimator says.
        attitude, memory: of an attitude filter, not read.
        left: actuators that the control holds for failed.
    """
    sun_b, omega_bn_b = truth.sun_b, truth.omega_bn_b
    t = tallies.totals[c]
    sunlit = (marks & SUNLIT) != 0
    estimated = heading.validity != VALIDITY_NONE
    sampled = step % tallies.sample_every == 0
    if not sunlit:
        t.run = 0
    error = _DEG * angle_between(heading.sun_b, sun_b) if estimated else math.nan
    if estimated and not sunlit:
        t.dark += 1
        t.dark_sum += error
    if estimated and (marks & DAWN) != 0:
        t.dawn += 1
        t.dawn_sum += error
    if sunlit or sampled:
        pointing = _DEG * angle_between(sun_b, truth.array_normal_b)
        if sunlit:
            _tally_sunlit(tallies, c, step, marks, pointing, error)
        if sampled:
            _tally_sample(tallies, c, step, pointing, error, sun_b, omega_bn_b, heading)
    if (marks & (REPORTED | FINAL)) != 0:
        rate = _DEG * norm(omega_bn_b)
        if (marks & REPORTED) != 0:
            t.reported += 1
            t.reported_sum += rate
            t.reported_knowledge_sum += _DEG * norm(subtract(heading.omega_bn_b, omega_bn_b))
        if (marks & FINAL) != 0:
            t.final += 1
            t.final_sum += rate
    if heading.nis_dof > 0:
        t.innovations += heading.nis_dof
        t.nis_sum += heading.nis
    held = Held(heading.isolated, left.wheels, left.rods, held_sensors(heading.sensors_left))
    tally_health(tallies.health, c, step, truth.failing, held)
    t.momentum = norm(truth.wheel_momentum_b)
    t.momentum_max = max(t.momentum_max, t.momentum)
    t.steps += 1
    t.dipole_sum += truth.rod_dipole
    if tallies.detumbled_rate > 0.0 and t.detumbled_step < 0:
        t.slow_run = t.slow_run + 1 if _DEG * norm(omega_bn_b) < tallies.detumbled_rate else 0
        if t.slow_run > tallies.acquire_steps:
            t.detumbled_step = step - t.slow_run + 1


@kernel
def _tally_sunlit(tallies, c, step, marks, pointing, error) -> None:
    t = tallies.totals[c]
    away = pointing > _POWER_POSITIVE_DEG
    if away:
        if (marks & FIRST_PASS) != 0:
            t.away_first += 1
        else:
            t.away_later += 1
        t.kept_step = -1
    else:
        t.within += 1
        if t.kept_step < 0:
            t.kept_step = step
    if (marks & LATE) != 0:
        t.late_lit += 1
        if not away:
            t.late_within += 1
    t.sunlit_pointing_sum += pointing
    if math.isnan(error):
        t.without_estimate += 1
    else:
        t.sunlit_headings += 1
        t.sunlit_heading_sum += error
        if (marks & LATE) != 0:
            t.late += 1
            t.late_sum += error
    if t.acquired_step >= 0:
        _count(tallies, c, pointing, error)
        return
    if away:
        t.run = 0
        return
    tallies.pending[c, 0, t.run] = pointing
    tallies.pending[c, 1, t.run] = error
    t.run += 1
    if t.run > tallies.acquire_steps:
        t.acquired_step = step - t.run + 1
        for i in range(t.run):
            _count(tallies, c, tallies.pending[c, 0, i], tallies.pending[c, 1, i])


@kernel
def _count(tallies, c, pointing, error) -> None:
    """One sunlit step after acquisition."""
    t = tallies.totals[c]
    t.pointings += 1
    t.pointing_sum += pointing
    if not math.isnan(error):
        t.headings += 1
        t.heading_sum += error
        tallies.histogram[c, min(int(error / BIN_DEG), BINS - 1)] += 1


@kernel
def _tally_sample(tallies, c, step, pointing, error, sun_b, omega_bn_b, heading) -> None:
    t = tallies.totals[c]
    at = step // tallies.sample_every
    samples = tallies.samples
    samples[c, 0, at] = error
    samples[c, 1, at] = pointing
    samples[c, 2, at] = _DEG * norm(omega_bn_b)
    # also where the estimator holds an old rate for want of a new one: what it says is what control and user get
    samples[c, 3, at] = _DEG * norm(subtract(heading.omega_bn_b, omega_bn_b))
    if heading.covariance[0] >= 0.0 and not math.isnan(error):
        t.consistencies += 1
        t.nees_sum += tangent_nees_of(heading.sun_b, heading.covariance, sun_b)
