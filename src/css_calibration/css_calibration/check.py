# SPDX-License-Identifier: Apache-2.0
"""Which cells of a whole recording lie, when, and what shows it.

1. Where the Sun was: a truth; else attitude from rates, field and place; else the vote of all cells.
2. Outputs that no calibration explains, with wide bounds: stretches of faults, and their kinds.
3. The batch of `calibrate` over what is left, so that scale, tilts and dark levels are no faults.
4. With its narrow bounds the same again, and what only shows then: noise, ageing, shadows of structure.
5. Where the cells voted, all of it once more with the vote of those that did not lie, which may acquit others.
"""

from collections import Counter
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from css_calibration.attitude_guess import first_track
from css_calibration.batch_fit import Fit, fit
from css_calibration.calibration import ATTITUDE, BATCH, CURVES, SUN, Tell, reference_of
from css_calibration.cell_bounds import judged, narrow_bounds, wide_bounds
from css_calibration.cell_data import CellData, cell_data
from css_calibration.cell_fit_model import response_of
from css_calibration.errors import CalibrationError
from css_calibration.fault_stretches import Outputs, Stretch, stretches_of
from css_calibration.own_evidence import OwnEvidence, frozen_cells, own_evidence
from css_calibration.recorded import Recorded
from css_calibration.slow_faults import noisy_cells, spiky
from css_calibration.sun_along_rates import sun_along_rates
from css_calibration.sun_by_cells import sun_by_cells
from css_calibration.surroundings import Surroundings, surroundings_of
from css_calibration.unknowns import Ignorance, all_of
from css_calibration.verdicts import Found, Verdict, verdicts_of

CELLS = "cells"
"""Reference: the vote of all cells."""

_MOST = {ATTITUDE: 5000, SUN: 5000, BATCH: 1200, CELLS: 4000}
_NOMINAL = response_of(CURVES["okeefe"])
_ALONG = "rates hold the Sun still for a minute, over which the cells vote together"
_AT_ONCE = "no rates that fit the cells: they vote at each instant, and a fault that another Sun explains is not seen"
_MOST_LIARS = 0.5  # share of the cells that may be left out before the others are believed


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
        """No cell is known to fail."""
        return not any(verdict.accuses for verdict in self.verdicts)


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
    own = own_evidence(recorded)
    count = min(len(recorded.stamp_ns), _MOST[kind])
    rows = np.unique(np.linspace(0, len(recorded.stamp_ns) - 1, count).astype(np.int64))
    here = own.at(rows)
    thin = recorded.at(rows)
    around = surroundings_of(thin, with_field=kind == BATCH)
    notes = list(thin.notes)
    sun_b, dcm_bn = _sun(thin, around, kind, tell, notes)
    looked = _look(thin, cell_data(thin, around, sun_b, dcm_bn, _NOMINAL, 20.0), here, tell)
    if kind == CELLS and looked.left_out:
        # those that lie had their say in where the Sun was, and what they moved it by others seem to err by
        tell("vote of the others")
        others, along = _vote(_without(thin, looked.left_out))
        if along or _ALONG not in notes:
            sun_b = np.where(np.isfinite(others), others, sun_b)
            again = _look(thin, cell_data(thin, around, sun_b, dcm_bn, _NOMINAL, 20.0), here, tell)
            # fewer cells tell the Sun less well: their vote acquits, and accuses nobody
            looked = again if _cells(again.left_out) <= _cells(looked.left_out) else looked
    found = Found(
        looked.wide,
        looked.by_wide,
        stretches_of(looked.closer),
        looked.closer,
        frozen_cells(recorded, own),
        noisy_cells(recorded),
        spiky(looked.closer),
    )
    tell("noise, ageing and shadows")
    return Checked(thin, kind, verdicts_of(recorded, thin, looked.data, looked.result, found), notes + _notes(kind))


class _Looked(NamedTuple):
    """What is found with the Sun as it is known.

    Attributes:
        wide, by_wide: stretches of faults by wide bounds, and the outputs by those.
        result, data: the batch over what is healthy.
        closer: outputs by its bounds.
        left_out: stretches that the batch did without.
    """

    wide: list[Stretch]
    by_wide: Outputs
    result: Fit
    data: CellData
    closer: Outputs
    left_out: list[Stretch]


def _look(thin: Recorded, data: CellData, own: OwnEvidence, tell: Tell) -> _Looked:
    if not (data.usable & data.seen).any():
        raise CalibrationError(f"{thin.origin}: the Sun is never known to shine on a cell, expected some minutes")
    tell("outputs that no calibration explains")
    outputs = judged(thin, data, wide_bounds(data), own)
    wide = stretches_of(outputs)
    tell("batch over the others")
    return _Looked(wide, outputs, *_without_liars(thin, data, wide, own))


def _cells(stretches: list[Stretch]) -> set[int]:
    return {one.cell for one in stretches}


def _without(thin: Recorded, stretches: list[Stretch]) -> Recorded:
    """The same with the outputs of stretches missing."""
    voltages = thin.voltages.copy()
    for one in stretches:
        voltages[one.first : one.last + 1, one.cell] = np.nan
    return replace(thin, voltages=voltages)


def _reference(recorded: Recorded, asked: str) -> str:
    if asked == "cells":
        return CELLS
    try:
        return reference_of(recorded, asked)
    except CalibrationError:
        if asked != "auto":
            raise
        return CELLS


def _notes(kind: str) -> list[str]:
    notes = []
    if kind == CELLS:
        notes.append("nothing but the cells tells where the Sun was: a fault of most of them would not be seen")
    if kind in (CELLS, SUN):
        notes.append("the light of the Earth is not predicted: what may be such light is no contradiction")
    return notes


def _sun(
    thin: Recorded, around: Surroundings, kind: str, tell: Tell, notes: list[str]
) -> tuple[np.ndarray, np.ndarray | None]:
    """Sun in b (M, 3), NaN where unknown, and attitude; says in `notes` what a vote goes by."""
    if kind in (ATTITUDE, SUN):
        assert thin.sun_b is not None
        return thin.sun_b, thin.dcm_bn
    if kind == CELLS:
        sun_b, along = _vote(thin)
        notes.append(_ALONG if along else _AT_ONCE)
        return sun_b, None
    tell("attitude from rates, field and place")
    track, rows = first_track(thin, around)
    part, of_part = thin.at(rows), surroundings_of(thin.at(rows), with_field=True)
    dcm_bn, _ = track.attitudes(np.zeros(track.count))
    sun = np.einsum("kij,kj->ki", dcm_bn, track.sun_n)
    data = cell_data(part, of_part, sun, dcm_bn, _NOMINAL, 20.0)
    unknowns = all_of(data.voltages.shape[1], temperature=False, earth=True, ignorance=Ignorance())
    result = fit(data, unknowns, track)
    dcm_bn, _ = track.attitudes(result.x[unknowns.count :])
    all_sun, all_dcm = np.full((len(thin.stamp_ns), 3), np.nan), np.full((len(thin.stamp_ns), 3, 3), np.nan)
    all_sun[rows] = np.einsum("kij,kj->ki", dcm_bn, track.sun_n)
    all_dcm[rows] = dcm_bn
    return all_sun, all_dcm


def _vote(thin: Recorded) -> tuple[np.ndarray, bool]:
    """Sun in b (M, 3) by the vote of the cells, NaN where unknown, and whether they vote along the rates."""
    sun_b = sun_along_rates(thin)
    return (sun_by_cells(thin), False) if sun_b is None else (sun_b, True)


def _without_liars(
    thin: Recorded, data: CellData, wide: list[Stretch], own: OwnEvidence
) -> tuple[Fit, CellData, Outputs, list[Stretch]]:
    """The batch over what is healthy, all outputs by its bounds, and what was left out.

    What one cell makes up spoils what all have in common, the Earth, noise and response, and then others seem to lie.
    So the worst one alone is left out at a time, and the others are asked again.
    """
    left_out = list(wide)
    while True:
        result, calibrated = _calibrated(data, left_out)
        outputs = judged(thin, calibrated, narrow_bounds(calibrated, result), own)
        known = {stretch.cell for stretch in left_out}
        bad: Counter[int] = Counter()
        for stretch in stretches_of(outputs):
            if stretch.cell not in known:
                bad[stretch.cell] += stretch.bad
        if not bad or len(known) > _MOST_LIARS * data.voltages.shape[1]:
            return result, calibrated, outputs, left_out
        worst = max(bad, key=lambda cell: bad[cell])
        left_out += [stretch for stretch in stretches_of(outputs) if stretch.cell == worst]


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
