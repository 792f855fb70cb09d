# SPDX-License-Identifier: Apache-2.0
"""Which cells of a whole recording lie, when, and what shows it.

1. Where the Sun was: a truth; else attitude from rates, field and place; else the vote of all cells.
2. Outputs that no calibration explains, with wide bounds: stretches of faults, and their kinds.
3. The batch of `calibrate` over what is left, so that scale, tilts and dark levels are no faults.
4. With its narrow bounds the same again, and what only shows then: noise, ageing, shadows of structure.
"""

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from css_calibration.attitude_guess import first_track
from css_calibration.batch_fit import Fit, fit
from css_calibration.calibration import ATTITUDE, BATCH, CURVES, SUN, Tell, reference_of
from css_calibration.cell_data import CellData, cell_data
from css_calibration.cell_fit_model import DARK, GAIN, nominal_parameters, response_of
from css_calibration.errors import CalibrationError
from css_calibration.fault_stretches import Outputs, Stretch, kind_in, stretches_of
from css_calibration.recorded import Recorded
from css_calibration.shadow_map import Shadow, shadows_of
from css_calibration.slow_faults import Slow, ageing, noisy_cells
from css_calibration.sun_by_cells import sun_by_cells
from css_calibration.surroundings import Surroundings, surroundings_of
from css_calibration.unknowns import Ignorance, all_of
from css_common.health import (
    KIND_BIAS,
    KIND_DEAD,
    KIND_DRIFTING,
    KIND_INTERMITTENT,
    KIND_SCALED,
    KIND_SHADOWED,
    KIND_SILENT,
)
from css_common.health_words import KIND_WORDS
from css_sensors.cells import LARGEST_READING

HEALTHY = "healthy"
CELLS = "cells"
"""Reference: the vote of all cells."""

_MOST = {ATTITUDE: 5000, SUN: 5000, BATCH: 1200, CELLS: 4000}
_ABSOLUTE, _SHARE, _EARTH, _CLOUDED = 0.08, 0.35, 0.3, 3.0  # bounds on cells that nobody has calibrated
_SIGMAS, _LEAST_OFF = 5.0, 0.03  # bounds on calibrated ones
_LEAPS = 5.0 * math.sqrt(6.0)
_LEAP_SHARE = 0.15
_FASTEST = 0.1  # [rad/s] of a body whose rate is not recorded
_SCALE, _LEVEL = 0.35, 0.12  # a calibration beyond them is a fault
_CALIBRATED = 0.1  # of scale, 1 sigma
_SEVERAL = 3
_LEAST_MISSING, _SHARE_MISSING = 20, 0.05


class Verdict(NamedTuple):
    """What is thought of a cell over a stretch of time."""

    cell: int
    verdict: str
    evidence: str
    first_ns: int
    last_ns: int
    directions_b: tuple[tuple[float, float, float], ...] = ()  # of the Sun, for a shadow


@dataclass
class Checked:
    """What a check came to.

    Attributes:
        recorded: what was looked at, thinned.
        reference: how the Sun was known.
        verdicts: at least one a cell.
        notes: what was assumed or left out, one line each.
    """

    recorded: Recorded
    reference: str
    verdicts: list[Verdict]
    notes: list[str] = field(default_factory=list)

    @property
    def healthy(self) -> bool:
        """All cells are."""
        return all(verdict.verdict == HEALTHY for verdict in self.verdicts)


def check(recorded: Recorded, *, reference: str = "auto", tell: Tell = lambda _: None) -> Checked:
    """Looks at all cells of a recording.

    Args:
        reference: auto, truth, batch or cells.
        tell: takes a line about each step.

    Raises:
        CalibrationError: what is asked for is not there, or the Sun is never known.
    """
    kind = _reference(recorded, reference)
    tell(f"reference: {kind}")
    leaps, same = _by_themselves(recorded)
    count = min(len(recorded.stamp_ns), _MOST[kind])
    rows = np.unique(np.linspace(0, len(recorded.stamp_ns) - 1, count).astype(np.int64))
    leaps, same = _between(leaps, rows), _between(same, rows)
    thin = recorded.at(rows)
    around = surroundings_of(thin, with_field=kind == BATCH)
    sun_b, dcm_bn = _sun(thin, around, kind, tell)
    data = cell_data(thin, around, sun_b, dcm_bn, response_of(CURVES["okeefe"]), 20.0)
    if not (data.usable & data.seen).any():
        raise CalibrationError(f"{recorded.origin}: the Sun is never known to shine on a cell, expected some minutes")
    tell("outputs that no calibration explains")
    outputs = _outputs(thin, data, _wide(data), leaps, same)
    wide = stretches_of(outputs)
    tell("batch over the others")
    result, data = _calibrated(data, wide)
    closer = _outputs(thin, data, _narrow(data, result), leaps, same)
    found = _Found(wide, outputs, stretches_of(closer), closer)
    tell("noise, ageing and shadows")
    return Checked(thin, kind, _verdicts(recorded, thin, data, result, found), _notes(thin, kind))


def _reference(recorded: Recorded, asked: str) -> str:
    if asked == "cells":
        return CELLS
    try:
        return reference_of(recorded, asked)
    except CalibrationError:
        if asked != "auto":
            raise
        return CELLS


def _notes(recorded: Recorded, kind: str) -> list[str]:
    notes = list(recorded.notes)
    if kind == CELLS:
        notes.append("nothing but the cells tells where the Sun was: a fault of most of them would not be seen")
    if kind in (CELLS, SUN):
        notes.append("the light of the Earth is not predicted: what may be such light is no contradiction")
    return notes


def _by_themselves(recorded: Recorded) -> tuple[np.ndarray, np.ndarray]:
    """(M, N) leaps of outputs, and outputs that stay the same while others change, at the rate of the recording."""
    v = recorded.voltages
    leaps, same = np.zeros(v.shape, np.bool_), np.zeros(v.shape, np.bool_)
    second = np.abs(v[2:] - 2.0 * v[1:-1] + v[:-2])
    noise = 1.4826 * np.nanmedian(second, axis=0) / math.sqrt(6.0)
    largest = np.fmax(np.fmax(v[2:], v[1:-1]), v[:-2])
    # a body that turns by so much between samples makes second differences, too
    rates = np.linalg.norm(recorded.gyro_b, axis=1)
    turn = (float(np.percentile(rates, 95.0)) if len(rates) else _FASTEST) * recorded.period_s
    usual = max(float(np.nanmedian(noise)), 1e-4)
    limit = np.maximum(_LEAPS * usual, _LEAP_SHARE * largest) + 3.0 * min(turn, 0.3) ** 2
    leaps[2:] = second > limit
    same[1:] = v[1:] == v[:-1]
    changed = np.sum(~same & (np.abs(v) > 0.1), axis=1)
    same &= (changed > 0)[:, None]
    return leaps, same


def _between(flags: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Flags at some rows: set when they are for most samples from the row before on."""
    sums = np.vstack([np.zeros((1, flags.shape[1]), np.int64), np.cumsum(flags, axis=0)])
    before = np.concatenate([[-1], rows[:-1]])
    return (sums[rows + 1] - sums[before + 1]) > 0.3 * (rows - before)[:, None]


def _sun(thin: Recorded, around: Surroundings, kind: str, tell: Tell) -> tuple[np.ndarray, np.ndarray | None]:
    """Sun in b (M, 3), NaN where unknown, and attitude."""
    if kind in (ATTITUDE, SUN):
        assert thin.sun_b is not None
        return thin.sun_b, thin.dcm_bn
    if kind == CELLS:
        count = thin.voltages.shape[1]
        normals_b = np.asarray(thin.mission.values.cells.normals)
        return sun_by_cells(thin, np.ones(count), np.zeros(count), normals_b), None
    tell("attitude from rates, field and place")
    track, rows = first_track(thin, around)
    part, of_part = thin.at(rows), surroundings_of(thin.at(rows), with_field=True)
    dcm_bn, _ = track.attitudes(np.zeros(track.count))
    sun = np.einsum("kij,kj->ki", dcm_bn, track.sun_n)
    data = cell_data(part, of_part, sun, dcm_bn, response_of(CURVES["okeefe"]), 20.0)
    unknowns = all_of(data.voltages.shape[1], temperature=False, earth=True, ignorance=Ignorance())
    result = fit(data, unknowns, track)
    dcm_bn, _ = track.attitudes(result.x[unknowns.count :])
    all_sun, all_dcm = np.full((len(thin.stamp_ns), 3), np.nan), np.full((len(thin.stamp_ns), 3, 3), np.nan)
    all_sun[rows] = np.einsum("kij,kj->ki", dcm_bn, track.sun_n)
    all_dcm[rows] = dcm_bn
    return all_sun, all_dcm


def _outputs(
    thin: Recorded, data: CellData, bounds: tuple[np.ndarray, ...], leaps: np.ndarray, same: np.ndarray
) -> Outputs:
    expected, low, high = bounds
    known = data.usable | (thin.saturated & np.isfinite(thin.voltages) & _usable_but_for_limit(thin, data))
    # at the edge of its view a healthy cell leaps, too: there the light is not known
    bad = known & ((thin.voltages < low) | (thin.voltages > high))
    return Outputs(thin.time, thin.voltages, np.where(known, expected, np.nan), bad, leaps & known, same)


def _usable_but_for_limit(thin: Recorded, data: CellData) -> np.ndarray:
    """Outputs at the limit of a converter, where the light is known all the same."""
    others = np.any(data.usable, axis=1, keepdims=True)
    return others & (thin.voltages <= thin.mission.values[LARGEST_READING])


def _wide(data: CellData) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What nominal cells should read, and bounds for cells that nobody has calibrated."""
    expected, _, _ = data.predicted(nominal_parameters(data.voltages.shape[1]), 1.0)
    # clouds over all that a cell sees make it three times as bright as the mean
    earth = np.minimum(_CLOUDED * data.albedo, _EARTH) if data.earth_known else np.full_like(expected, _EARTH)
    off = _ABSOLUTE + _SHARE * expected
    return expected, expected - off - data.albedo, expected + off + earth


def _narrow(data: CellData, result: Fit) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What calibrated cells should read, and bounds by their noise."""
    expected, slopes, _ = data.predicted(result.parameters, result.earth)
    sigma = np.sqrt(result.noise.variance(expected, slopes[:, :, -1], result.parameters))
    # cells whose tilts were hardly told err by them
    tilt = 0.03 * np.sqrt(np.maximum(0.0, 1.0 - np.minimum(1.0, expected) ** 2)) * (expected > 0.1)
    off = _SIGMAS * sigma + _LEAST_OFF + tilt
    earth = 0.0 if data.earth_known else _EARTH
    return expected, expected - off - 0.5 * data.albedo, expected + off + 0.8 * data.albedo + earth


def _calibrated(data: CellData, wide: list[Stretch]) -> tuple[Fit, CellData]:
    """The batch without stretches of faults, by the better response."""
    usable = data.usable.copy()
    for stretch in wide:
        usable[stretch.first : stretch.last + 1, stretch.cell] = False
    unknowns = all_of(
        data.voltages.shape[1],
        temperature=False,
        earth=bool(data.albedo.max(initial=0.0) > 0.02),
        ignorance=Ignorance(),
    )
    tried = []
    for curve in CURVES.values():
        one = replace(data, response=response_of(curve), usable=usable)
        result = fit(one, unknowns)
        lit = one.seen & usable & (one.voltages > 0.2)
        tried.append((float(np.median(np.abs(result.residuals[lit]))) if lit.any() else 0.0, result, curve))
    _, result, curve = min(tried, key=lambda entry: entry[0])
    return result, replace(data, response=response_of(curve))


class _Found(NamedTuple):
    """Stretches of faults, by wide bounds and by narrow ones, with the outputs by which they were found."""

    wide: list[Stretch]
    by_wide: Outputs
    close: list[Stretch]
    by_close: Outputs

    def of(self, cell: int) -> "_Found":
        return self._replace(
            wide=[s for s in self.wide if s.cell == cell], close=[s for s in self.close if s.cell == cell]
        )


def _verdicts(recorded: Recorded, thin: Recorded, data: CellData, result: Fit, found: _Found) -> list[Verdict]:
    verdicts: list[Verdict] = []
    noise = noisy_cells(recorded)
    for cell in range(data.voltages.shape[1]):
        told = _of_cell(thin, data, result, cell, found.of(cell))
        slow = noise.get(cell)
        if slow is not None and not told:
            told = [_slow_verdict(thin, cell, slow)]
        verdicts += told or [_healthy(thin, data, result, cell)]
    return verdicts


def _of_cell(thin: Recorded, data: CellData, result: Fit, cell: int, found: _Found) -> list[Verdict]:
    silent = _silent(thin, cell)
    if silent is not None:
        return [silent]
    shadow = shadows_of(data, result, cell)
    if shadow is not None and not _explained(found.wide, shadow):
        return [_shadow_verdict(thin, cell, shadow)]
    age = ageing(data, result, cell)
    stretches = (*found.wide, *found.close)
    if age is not None and len(stretches) <= _SEVERAL and all(s.kind in _AGEING_LIKE for s in stretches):
        return [_slow_verdict(thin, cell, age)]
    if found.wide:
        return [_stretch_verdict(thin, s) for s in _joined(found.wide, found.by_wide)]
    if found.close:
        return [_stretch_verdict(thin, s) for s in _joined(found.close, found.by_close)]
    return _beyond_calibration(thin, result, cell)


def _silent(thin: Recorded, cell: int) -> Verdict | None:
    """A cell without readings while others have some."""
    others = np.isfinite(thin.voltages).any(axis=1)
    missing = np.flatnonzero(others & ~np.isfinite(thin.voltages[:, cell]))
    if len(missing) < _LEAST_MISSING or len(missing) < _SHARE_MISSING * others.sum():
        return None
    evidence = f"{len(missing)} of {int(others.sum())} readings are missing"
    stamps = thin.stamp_ns[missing]
    return Verdict(cell, KIND_WORDS[KIND_SILENT], evidence, int(stamps[0]), int(stamps[-1]))


_AGEING_LIKE = (KIND_DRIFTING, KIND_SCALED, KIND_BIAS)


def _explained(wide: list[Stretch], shadow: Shadow) -> bool:
    """Whether one long fault says it better than a direction."""
    return len(wide) == 1 and wide[0].bad > 0.9 * shadow.shaded


def _joined(stretches: list[Stretch], outputs: Outputs) -> list[Stretch]:
    """Several stretches are one where that says it: a cell that fails now and then, or many times in one way."""
    if len(stretches) < 2:
        return stretches
    first, last = stretches[0], stretches[-1]
    kinds = [s.kind for s in stretches]
    kind = kind_in(outputs, first.cell, first.first, last.last)
    if kind != KIND_INTERMITTENT:
        if len(stretches) < _SEVERAL:
            return stretches
        kind = KIND_INTERMITTENT if kinds.count(KIND_DEAD) > 0.5 * len(kinds) else max(set(kinds), key=kinds.count)
    return [
        Stretch(first.cell, first.first, last.last, kind, sum(s.bad for s in stretches), sum(s.of for s in stretches))
    ]


def _stretch_verdict(thin: Recorded, s: Stretch) -> Verdict:
    evidence = f"{s.bad} of {s.of} outputs contradict the light on it"
    return Verdict(s.cell, KIND_WORDS[s.kind], evidence, int(thin.stamp_ns[s.first]), int(thin.stamp_ns[s.last]))


def _slow_verdict(thin: Recorded, cell: int, slow: Slow) -> Verdict:
    return Verdict(cell, KIND_WORDS[slow.kind], slow.evidence, int(thin.stamp_ns[0]), int(thin.stamp_ns[-1]))


def _shadow_verdict(thin: Recorded, cell: int, shadow: Shadow) -> Verdict:
    return Verdict(
        cell, KIND_WORDS[KIND_SHADOWED], shadow.evidence, int(thin.stamp_ns[shadow.first]),
        int(thin.stamp_ns[shadow.last]), shadow.directions_b,
    )  # fmt: skip


def _beyond_calibration(thin: Recorded, result: Fit, cell: int) -> list[Verdict]:
    """A cell whose scale or dark level no calibration should have."""
    parameters, unknowns = result.parameters, result.unknowns
    columns = unknowns.column_of()
    left = np.sqrt(np.diag(result.covariance))
    begin, end = int(thin.stamp_ns[0]), int(thin.stamp_ns[-1])
    gain, dark = parameters[cell, GAIN], parameters[cell, DARK]
    of_gain = left[columns[cell, GAIN]] * unknowns.ignorance.gain
    if of_gain < _CALIBRATED and abs(gain - 1.0) > _SCALE + 3.0 * of_gain:
        return [Verdict(cell, KIND_WORDS[KIND_SCALED], f"its scale is {gain:.3f} +- {of_gain:.3f}", begin, end)]
    if abs(dark) > _LEVEL:
        return [Verdict(cell, KIND_WORDS[KIND_BIAS], f"it reads {dark:.3f} in the dark", begin, end)]
    return []


def _healthy(thin: Recorded, data: CellData, result: Fit, cell: int) -> Verdict:
    off = result.residuals[:, cell]
    off = off[np.isfinite(off) & ~result.outliers[:, cell]]
    lit = int((data.seen & data.usable)[:, cell].sum())
    evidence = f"{lit} lit outputs as expected" if lit else "never in the Sun: only what it reads in the dark is known"
    if len(off):
        evidence += f", residual {float(np.sqrt(np.mean(off**2))):.3f} rms"
    return Verdict(cell, HEALTHY, evidence, int(thin.stamp_ns[0]), int(thin.stamp_ns[-1]))
