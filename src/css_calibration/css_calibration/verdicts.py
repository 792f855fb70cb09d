# SPDX-License-Identifier: Apache-2.0
"""From stretches of faults, and what outputs show by themselves, to what is thought of each cell."""

from typing import NamedTuple

import numpy as np

from css_calibration.batch_fit import Fit
from css_calibration.cell_bounds import dark_levels
from css_calibration.cell_data import CellData
from css_calibration.cell_fit_model import DARK, GAIN
from css_calibration.fault_stretches import Outputs, Stretch, kind_in
from css_calibration.kinds_apart import Kinds, kinds_in
from css_calibration.own_evidence import Frozen
from css_calibration.recorded import Recorded
from css_calibration.shadow_map import Shadow, shadows_of
from css_calibration.slow_faults import Slow, ageing
from css_common.health import (
    KIND_BIAS,
    KIND_DEAD,
    KIND_DRIFTING,
    KIND_INTERMITTENT,
    KIND_NOISY,
    KIND_SCALED,
    KIND_SHADOWED,
    KIND_SILENT,
    KIND_SPIKES,
    KIND_STUCK,
)
from css_common.health_words import KIND_WORDS

HEALTHY = "healthy"
UNTOLD = "not enough evidence"
"""Neither healthy nor failing: nothing of the recording would show it."""

_SCALE, _LEVEL = 0.35, 0.12  # a calibration beyond them is a fault
_CALIBRATED = 0.1  # 1 sigma
_SEVERAL = 3
_LIT, _RIGHT = 0.2, 0.15
_FEWEST_LIT = 20  # outputs by which a cell is healthy
_LEAST_MISSING, _SHARE_MISSING = 20, 0.05


class Verdict(NamedTuple):
    """What is thought of a cell over a stretch of time."""

    cell: int
    verdict: str
    evidence: str
    first_ns: int
    last_ns: int
    directions_b: tuple[tuple[float, float, float], ...] = ()  # of the Sun, for a shadow
    others: tuple[str, ...] = ()  # verdicts that the recording does not tell from this one

    @property
    def accuses(self) -> bool:
        """The cell fails."""
        return self.verdict not in (HEALTHY, UNTOLD)

    @property
    def words(self) -> str:
        """The verdict with what is not told from it."""
        return " or ".join((self.verdict, *self.others))


class Found(NamedTuple):
    """Stretches of faults, by wide bounds and by narrow ones, with the outputs by which they were found."""

    wide: list[Stretch]
    by_wide: Outputs
    close: list[Stretch]
    by_close: Outputs
    frozen: dict[int, Frozen]
    noisy: dict[int, Slow]
    spiky: dict[int, tuple[int, int]]  # first and last instant

    def of(self, cell: int) -> "Found":
        """Those of one cell."""
        return self._replace(
            wide=[s for s in self.wide if s.cell == cell], close=[s for s in self.close if s.cell == cell]
        )


def verdicts_of(recorded: Recorded, thin: Recorded, data: CellData, result: Fit, found: Found) -> list[Verdict]:
    """At least one verdict a cell.

    Args:
        recorded, thin: the recording, and the instants of it that were looked at.
        data, result: the light on the cells, and the batch over what is healthy.
    """
    verdicts: list[Verdict] = []
    for cell in range(data.voltages.shape[1]):
        told = _of_cell(recorded, thin, data, result, cell, found.of(cell))
        if not told and cell in found.noisy:
            told = [_slow_verdict(thin, cell, found.noisy[cell])]
        if not told and cell in found.spiky:
            told = [_spiky_verdict(thin, found, cell)]
        verdicts += told or [_healthy(thin, data, result, cell)]
    return verdicts


def _of_cell(recorded: Recorded, thin: Recorded, data: CellData, result: Fit, cell: int, found: Found) -> list[Verdict]:
    silent = _silent(thin, cell)
    if silent is not None:
        return [silent]
    if cell in found.frozen:
        return [_frozen_verdict(recorded, thin, found, cell)]
    shadow = shadows_of(data, result, cell)
    if shadow is not None and not _explained(found.wide, shadow):
        return [_shadow_verdict(thin, cell, shadow)]
    age = ageing(data, result, cell)
    every = (*found.wide, *found.close)
    if age is not None and len(every) <= _SEVERAL and all(s.kind in _AGEING_LIKE for s in every):
        return [_slow_verdict(thin, cell, age)]
    for stretches, outputs in ((found.wide, found.by_wide), (found.close, found.by_close)):
        if stretches:
            return [_stretch_verdict(thin, s, found, outputs) for s in _joined(stretches, outputs)]
    return _beyond_calibration(thin, data, result, cell)


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
    first, last = stretches[0], stretches[-1]
    if len(stretches) == 1:
        comes_back = first.kind == KIND_DEAD and _is_right_after(outputs, first)
        return [first._replace(kind=KIND_INTERMITTENT)] if comes_back else stretches
    kinds = [s.kind for s in stretches]
    kind = kind_in(outputs, first.cell, first.first, last.last)
    if kind != KIND_INTERMITTENT:
        if len(stretches) < _SEVERAL:
            return stretches
        kind = KIND_INTERMITTENT if kinds.count(KIND_DEAD) > 0.5 * len(kinds) else max(set(kinds), key=kinds.count)
    return [
        Stretch(first.cell, first.first, last.last, kind, sum(s.bad for s in stretches), sum(s.of for s in stretches))
    ]


def _is_right_after(outputs: Outputs, s: Stretch) -> bool:
    """Whether a cell is lit and right once a stretch has ended."""
    v, e = outputs.voltages[s.last + 1 :, s.cell], outputs.expected[s.last + 1 :, s.cell]
    return int(np.sum((v > _LIT) & (np.abs(v - e) < _RIGHT))) >= _FEWEST_LIT


def _stretch_verdict(thin: Recorded, s: Stretch, found: Found, outputs: Outputs) -> Verdict:
    evidence = f"{s.bad} of {s.of} outputs contradict the light on it"
    kinds = kinds_in(outputs, s.cell, s.first, s.last, s.kind)
    leaping = s.cell in found.spiky and s.bad < 0.5 * s.of
    if leaping or s.kind in (KIND_SPIKES, KIND_NOISY):
        # noise is in most samples, and in the median of their differences, spikes are in few
        kinds = Kinds(KIND_NOISY if s.cell in found.noisy else KIND_SPIKES if leaping else s.kind)
    return _of_kinds(s.cell, kinds, evidence, int(thin.stamp_ns[s.first]), int(thin.stamp_ns[s.last]))


def _of_kinds(cell: int, kinds: Kinds, evidence: str, first_ns: int, last_ns: int) -> Verdict:
    others = tuple(KIND_WORDS[kind] for kind in kinds.others)
    return Verdict(cell, KIND_WORDS[kinds.best], evidence, first_ns, last_ns, others=others)


def _frozen_verdict(recorded: Recorded, thin: Recorded, found: Found, cell: int) -> Verdict:
    """A cell that reads one number, or none above it."""
    frozen = found.frozen[cell]
    samples = np.flatnonzero(recorded.voltages[:, cell] == frozen.level)
    first_ns, last_ns = int(recorded.stamp_ns[samples[0]]), int(recorded.stamp_ns[samples[-1]])
    rows = np.searchsorted(thin.stamp_ns, (first_ns, last_ns))
    last = min(int(rows[1]), len(thin.stamp_ns) - 1)
    kinds = kinds_in(found.by_wide, cell, int(rows[0]), last, KIND_STUCK)
    evidence = f"it reads {frozen.level:.4g} to the last bit in {len(samples)} samples, while others as bright change"
    return _of_kinds(cell, kinds, evidence, first_ns, last_ns)


def _spiky_verdict(thin: Recorded, found: Found, cell: int) -> Verdict:
    first, last = found.spiky[cell]
    leaps = int(found.by_close.leaps[:, cell].sum())
    evidence = f"it leaps at {leaps} of {len(thin.stamp_ns)} instants, where it is right at the others"
    return _of_kinds(cell, Kinds(KIND_SPIKES), evidence, int(thin.stamp_ns[first]), int(thin.stamp_ns[last]))


def _slow_verdict(thin: Recorded, cell: int, slow: Slow) -> Verdict:
    return Verdict(cell, KIND_WORDS[slow.kind], slow.evidence, int(thin.stamp_ns[0]), int(thin.stamp_ns[-1]))


def _shadow_verdict(thin: Recorded, cell: int, shadow: Shadow) -> Verdict:
    return Verdict(
        cell, KIND_WORDS[KIND_SHADOWED], shadow.evidence, int(thin.stamp_ns[shadow.first]),
        int(thin.stamp_ns[shadow.last]), shadow.directions_b,
    )  # fmt: skip


def _beyond_calibration(thin: Recorded, data: CellData, result: Fit, cell: int) -> list[Verdict]:
    """A cell whose scale or dark level no calibration should have."""
    parameters, unknowns = result.parameters, result.unknowns
    columns = unknowns.column_of()
    left = np.sqrt(np.diag(result.of_outputs))
    begin, end = int(thin.stamp_ns[0]), int(thin.stamp_ns[-1])
    gain, dark = parameters[cell, GAIN], dark_levels(data, result)[cell]
    of_gain = left[columns[cell, GAIN]] * unknowns.ignorance.gain
    # by the Sun alone: what shines on a cell that only sees the Earth, nobody knows so well
    sunlit = int((data.seen & data.usable & (data.voltages > _LIT))[:, cell].sum())
    if sunlit >= _FEWEST_LIT and of_gain < _CALIBRATED and abs(gain - 1.0) > _SCALE + 3.0 * of_gain:
        return [Verdict(cell, KIND_WORDS[KIND_SCALED], f"its scale is {gain:.3f} +- {of_gain:.3f}", begin, end)]
    # lit from one side alone a cell tells no dark level, and what a batch puts there is no fault
    of_dark = left[columns[cell, DARK]] * unknowns.ignorance.dark
    if of_dark < _CALIBRATED and abs(dark) > _LEVEL + 3.0 * of_dark:
        evidence = f"it reads {dark:.3f} +- {of_dark:.3f} in the dark"
        return [Verdict(cell, KIND_WORDS[KIND_BIAS], evidence, begin, end)]
    return []


def _healthy(thin: Recorded, data: CellData, result: Fit, cell: int) -> Verdict:
    off = result.residuals[:, cell]
    off = off[np.isfinite(off) & ~result.outliers[:, cell]]
    lit = int((data.seen & data.usable)[:, cell].sum())
    evidence = f"{lit} lit outputs as expected" if lit else "never in the Sun: only what it reads in the dark is known"
    if len(off):
        evidence += f", residual {float(np.sqrt(np.mean(off**2))):.3f} rms"
    word = HEALTHY if lit >= _FEWEST_LIT else UNTOLD
    return Verdict(cell, word, evidence, int(thin.stamp_ns[0]), int(thin.stamp_ns[-1]))
