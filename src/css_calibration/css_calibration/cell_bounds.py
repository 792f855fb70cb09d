# SPDX-License-Identifier: Apache-2.0
"""What healthy cells may read: wide bounds where nobody has calibrated them, narrow ones by a calibration.

A bound is as wide as what nobody knows: light of clouds, scale, dark level, tilt and response, and for cells that are
calibrated noise and what the calibration itself is uncertain by. At the edge of a view, where a tilt decides whether
the Sun is in it, an output may be anything from what it is without the Sun to what it is with it.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from css_calibration.batch_fit import Fit
from css_calibration.cell_data import CellData
from css_calibration.cell_fit_model import DARK, nominal_parameters
from css_calibration.fault_stretches import Outputs
from css_calibration.own_evidence import OwnEvidence
from css_calibration.recorded import Recorded
from css_sensors.cells import LARGEST_READING

_ABSOLUTE, _SHARE, _EARTH, _CLOUDED = 0.08, 0.35, 0.3, 3.0  # of cells that nobody has calibrated
_SIGMAS, _LEAST_OFF = 5.0, 0.03  # of calibrated ones

# Share of what cells read without the Sun, below or above which it is noise that made it so little or much.
_LOWEST = 0.02

Bounds = tuple[np.ndarray, np.ndarray, np.ndarray]
"""What is expected (M, N), the least and the most."""


def judged(thin: Recorded, data: CellData, bounds: Bounds, own: OwnEvidence) -> Outputs:
    """All outputs, and which of them contradict bounds."""
    expected, low, high = bounds
    known = data.usable | (thin.saturated & np.isfinite(thin.voltages) & _usable_but_for_limit(thin, data))
    bad = (known | data.at_edge) & ((thin.voltages < low) | (thin.voltages > high))
    # at the edge of its view a healthy cell leaps, too, from what it may read to what it may read
    leaps = own.leaps & (known | bad)
    expected = np.where(known | data.at_edge, expected, np.nan)
    return Outputs(thin.time, thin.voltages, expected, bad, leaps, own.same, data.at_edge)


def _usable_but_for_limit(thin: Recorded, data: CellData) -> np.ndarray:
    """Outputs at the limit of a converter, where the light is known all the same."""
    others = np.any(data.usable, axis=1, keepdims=True)
    return others & (thin.voltages <= thin.mission.values[LARGEST_READING])


def _in_doubt(data: CellData, of: Callable[[CellData], np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What a function gives where a Sun at the edge of a view is hidden, is as the output says, and is seen."""
    dark, lit = of(replace(data, seen=data.seen & ~data.at_edge)), of(replace(data, seen=data.seen | data.at_edge))
    plain = [one if one.ndim == 2 else one[0] for one in (dark, lit)]
    nearer = np.abs(data.voltages - plain[1]) < np.abs(data.voltages - plain[0])
    return dark, np.where(nearer, lit, dark), lit


def wide_bounds(data: CellData) -> Bounds:
    """What nominal cells should read, and bounds for cells that nobody has calibrated."""
    dark, expected, lit = _in_doubt(data, lambda one: one.predicted(nominal_parameters(data.voltages.shape[1]), 1.0)[0])
    # clouds over all that a cell sees make it three times as bright as the mean
    earth = np.minimum(_CLOUDED * data.albedo, _EARTH) if data.earth_known else np.full_like(expected, _EARTH)
    low = dark - _ABSOLUTE - _SHARE * dark - data.albedo
    return expected, low, lit + _ABSOLUTE + _SHARE * lit + earth


def dark_levels(data: CellData, result: Fit) -> np.ndarray:
    """(N,) of the batch, less the light of the Earth that it took for them where nobody predicts that.

    What shines on a cell now and then, and is not known, the batch takes for a dark level; but a cell that reads less
    at times has a lower one, by as much as the other cells show that there is light of the Earth.
    """
    levels = result.parameters[:, DARK].copy()
    lowest = _lowest(data)
    for cell in np.flatnonzero(np.isfinite(lowest)).tolist():
        levels[cell] -= np.clip(levels[cell] - lowest[cell], 0.0, unpredicted_earth(data, cell))
    return levels


def unpredicted_earth(data: CellData, cell: int) -> float:
    """The most light of the Earth [-] that the other cells show without the Sun, where none is predicted."""
    if data.earth_known:
        return 0.0
    above = _without_sun(data) - _lowest(data)
    above = np.delete(above, cell, axis=1)  # what is wrong with a cell is no light of the Earth
    return float(np.nanquantile(above, 1.0 - _LOWEST)) if np.isfinite(above).any() else 0.0


def _without_sun(data: CellData) -> np.ndarray:
    """(M, N) outputs of cells that do not see the Sun, NaN else."""
    return np.where(data.usable & ~data.seen, data.voltages, np.nan)


def _lowest(data: CellData) -> np.ndarray:
    """(N,) what cells read in their darkest moments, NaN where they always see the Sun."""
    lowest = np.full(data.voltages.shape[1], np.nan)
    unlit = _without_sun(data)
    told = np.isfinite(unlit).any(axis=0)
    lowest[told] = np.nanquantile(unlit[:, told], _LOWEST, axis=0)
    return lowest


def narrow_bounds(data: CellData, result: Fit) -> Bounds:
    """What calibrated cells should read, and bounds by their noise."""
    earth = 0.0 if data.earth_known else _EARTH
    # light of the Earth that nobody predicts, and that is not always there, has passed for a dark level
    taken = result.parameters[:, DARK] - dark_levels(data, result)

    def bounds(one: CellData) -> np.ndarray:
        expected, slopes, _ = one.predicted(result.parameters, result.earth)
        variance = result.noise.variance(expected, slopes[:, :, -1], result.parameters)
        # as far as the calibration itself is known, for the light that the cell has now
        sigma = np.sqrt(variance + result.prediction_variance(slopes))
        # cells whose tilts were hardly told err by them
        tilt = 0.03 * np.sqrt(np.maximum(0.0, 1.0 - np.minimum(1.0, expected) ** 2)) * (expected > 0.1)
        off = _SIGMAS * sigma + _LEAST_OFF + tilt
        low, high = expected - off - 0.5 * data.albedo - taken, expected + off + 0.8 * data.albedo + earth
        return np.stack([expected, low, high])

    dark, expected, lit = _in_doubt(data, bounds)
    return expected[0], dark[1], lit[2]
