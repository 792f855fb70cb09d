# SPDX-License-Identifier: Apache-2.0
"""What a calibration is worth to each Sun estimator: the recording replayed without it and with it.

With one that has not seen the end of the recording, over the end of it. What is done with the readings before an
estimator gets them counts, too: the health of the sensors may leave out other cells than before.
"""

import argparse
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy import stats

from css_analysis.flight_log import angle
from css_analysis.health_record import HealthRecord, health_records
from css_bringup.estimator_request import EstimatorRequest
from css_bringup.replay_pass import Replay
from css_calibration.calibration import Calibration, Tell, left_of
from css_calibration.calibration_result import calibration_file, not_told
from css_calibration.mission_of import remapping
from css_common.codec import codec_of
from css_common.message_columns import stack
from css_common.mission import Mission
from css_common.mission_extends import sections_of_text
from css_common.mission_file import MissionError
from css_estimation.sun.offered import estimators
from css_msgs.msg import Health, SunEstimate
from css_recording.bag_metadata import Topic
from css_recording.bag_reader import BagReader

CONFIDENCE = 0.99
"""Of the interval of a change: of eight estimators that are as before, one in 25 recordings calls one worse."""
_BATCHES, _FEWEST, _LEAST = 20, 5, 5  # stretches of time, fewest of them, instants in each
_NAMED = 4  # parameters in a line
_SAME_DEG = 1e-3  # by which a calibration of cells that were right already changes headings


class _Kept:
    """Takes what estimators give, as a recording would."""

    def __init__(self) -> None:
        self.types: dict[str, str] = {}
        self.messages: dict[str, list[bytes]] = defaultdict(list)

    def add_topic(self, topic: Topic) -> None:
        """Notes a topic."""
        self.types[topic.name] = topic.type

    def write(self, topic: str, stamp_ns: int, data: bytes) -> None:
        """Keeps a message."""
        self.messages[topic].append(data)

    def of(self, kind: type) -> list[bytes]:
        """All messages of a type."""
        codec = codec_of(kind)
        return [
            data for topic, found in self.messages.items() if self.types[topic] == codec.type_name for data in found
        ]


class _Run(NamedTuple):
    """One estimator over the recording, at the instants that were held out."""

    errors: np.ndarray  # (H,) [rad], NaN without an estimate
    isolated: np.ndarray  # (H,) masks of cells that it left out
    health: list[HealthRecord]


class LeftOut(NamedTuple):
    """A cell that an estimator leaves out with the calibration, for longer than without it."""

    cell: int
    before: float  # share of the instants
    after: float
    why: str  # in words, the first time


class Gain(NamedTuple):
    """What the calibration is worth to one estimator."""

    estimator: str
    before_deg: float  # mean error of the heading
    after_deg: float
    interval_deg: float | None  # half of the interval of their difference; None: too few instants
    instants: int
    left_out: tuple[LeftOut, ...]

    @property
    def is_worse(self) -> bool:
        """The heading errs by more, beyond the interval."""
        change = self.after_deg - self.before_deg
        return self.interval_deg is not None and change > self.interval_deg + _SAME_DEG

    def as_object(self) -> dict[str, Any]:
        """For `--json`."""
        return self._asdict() | {"worse": self.is_worse, "left_out": [cell._asdict() for cell in self.left_out]}


class Gains(NamedTuple):
    """Of all estimators, and why there are none of the others."""

    gains: list[Gain]
    notes: list[str]


def gains_of(c: Calibration, options: argparse.Namespace, tell: Tell) -> Gains:
    """What the calibration is worth to each Sun estimator that the recording can feed.

    Args:
        options: of the command: bag, remap, overrides.
        tell: takes a line about each step.
    """
    found = Gains([], [])
    if c.trained is None:
        return found
    without_end = replace(c, fit=c.trained, left=left_of(c.trained))
    sections = sections_of_text(calibration_file(without_end, c.recorded.origin, None), "calibration")
    lit = c.holdout & (c.data.usable & c.data.seen).any(axis=1)
    for name in estimators():
        tell(f"replaying through {name}, before and calibrated")
        try:
            missions = c.recorded.mission, c.recorded.mission.with_sections(sections)
            before, after = (_run(c, lit, name, options, mission) for mission in missions)
        except MissionError as error:
            found.notes.append(f"{name}: not compared: {error}")
            continue
        gain = _gain(name, before, after)
        if gain is None:
            found.notes.append(f"{name}: not compared: it gives no heading at the instants that were held out")
        else:
            found.gains.append(gain)
            lost = int(np.sum(np.isfinite(before.errors) & ~np.isfinite(after.errors)))
            if lost:
                found.notes.append(f"{name}: with the calibration it gives no heading at {lost} instants more")
    return found


def _run(c: Calibration, lit: np.ndarray, name: str, options: argparse.Namespace, mission: Mission) -> _Run:
    """Replays one estimator.

    Raises:
        MissionError: the recording cannot feed it, or it cannot be with such a mission.
    """
    kept = _Kept()
    with BagReader(options.bag, remapping(options)) as reader:
        Replay(reader, mission, [EstimatorRequest(name, name, {})], options.overrides).run(kept, ())
    health = codec_of(Health)
    records = health_records(name, [health.decode(data) for data in kept.of(Health)], mission.epoch_ns)
    wanted, sun_b = c.recorded.stamp_ns[lit], c.data.sun_b[lit]
    errors, isolated = np.full(len(wanted), np.nan), np.zeros(len(wanted), np.int64)
    if kept.of(SunEstimate):
        estimates = stack(codec_of(SunEstimate), kept.of(SunEstimate)).sorted()
        rows = np.clip(np.searchsorted(estimates.stamp_ns, wanted), 0, len(estimates) - 1)
        there = (estimates.stamp_ns[rows] == wanted) & (estimates.validity[rows] != SunEstimate.VALIDITY_NONE)
        isolated[there] = estimates.isolated[rows][there]
        errors[there] = angle(estimates.sun_b[rows][there], sun_b[there])
    return _Run(errors, isolated, records)


def _gain(name: str, before: _Run, after: _Run) -> Gain | None:
    both = np.isfinite(before.errors) & np.isfinite(after.errors)
    if not both.any():
        return None
    was, now = np.degrees(before.errors[both]), np.degrees(after.errors[both])
    left_out = tuple(_left_out(before, after))
    return Gain(name, float(was.mean()), float(now.mean()), half_interval(now - was), len(was), left_out)


def half_interval(changes: np.ndarray) -> float | None:
    """Half of the interval of the mean of changes (H,) in the order of time, by the means of stretches of time.

    What follows each other is alike; stretches that are long against that are not. None: too few to tell.
    """
    batches = min(_BATCHES, len(changes) // _LEAST)
    if batches < _FEWEST:
        return None
    means = [float(part.mean()) for part in np.array_split(changes, batches)]
    quantile = float(stats.t.ppf(0.5 + 0.5 * CONFIDENCE, batches - 1))
    return quantile * float(np.std(means, ddof=1)) / batches**0.5


def _left_out(before: _Run, after: _Run) -> Iterator[LeftOut]:
    for cell in range(32):
        was, now = (float(np.mean(run.isolated >> cell & 1)) for run in (before, after))
        if now > was:
            why = next((r.text() for r in after.health if r.target == f"cell.{cell}"), "")
            yield LeftOut(cell, was, now, why)


def gain_object(found: Gains) -> dict[str, Any]:
    """What `--json` has of it."""
    return {"estimators": [gain.as_object() for gain in found.gains], "not_compared": found.notes}


def worse_lines(c: Calibration, gains: list[Gain]) -> list[str]:
    """Of each estimator whose heading errs by more than before: by how much, and what it may be."""
    return [
        f"{gain.estimator}: the heading of the part that was held out errs by {gain.after_deg:.3f} deg, by "
        f"{gain.before_deg:.3f} before, beyond the interval of {gain.interval_deg:.3f} deg; {_cause(c, gain)}"
        for gain in gains
        if gain.is_worse
    ]


def _cause(c: Calibration, gain: Gain) -> str:
    if gain.left_out:
        worst, *others = sorted(gain.left_out, key=lambda cell: cell.before - cell.after)
        also = f"; cells {', '.join(str(cell.cell) for cell in others)} too" if others else ""
        return f"{_left_out_text(c, worst)}{also}"
    names = [f"{row.name} of cell {row.cell}" for row in not_told(c)[1]]
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    told = f", or what was told together with others alone: {', '.join(names[:_NAMED])}{more}" if names else ""
    return f"it leaves out no other cells; it may be that it averages over tilted cells or has gates for others{told}"


def _left_out_text(c: Calibration, left_out: LeftOut) -> str:
    off = c.fit.residuals[:, left_out.cell]
    off = off[np.isfinite(off) & ~c.fit.outliers[:, left_out.cell]]
    rms = f", though its outputs are {np.sqrt(np.mean(off**2)):.3f} rms off the calibration" if len(off) else ""
    shares = f"for {100.0 * left_out.after:.0f} % of it, for {100.0 * left_out.before:.0f} % before"
    return f"it leaves out cell {left_out.cell} {shares}{rms} ({left_out.why or 'without a word'})"
